// The pool: every item once, results independent of threads, errors and cancellation in order.
#include "base/pool.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "base/random.hpp"

namespace ulna {
namespace {

TEST(Pool, EveryItemRunsOnce) {
  for (const int threads : {0, 1, 2, 7, 200}) {
    std::vector<std::atomic<int>> runs(101);
    parallel_for(101, threads, [&](std::ptrdiff_t i) { ++runs[static_cast<std::size_t>(i)]; });
    for (const auto& count : runs) EXPECT_EQ(count.load(), 1) << threads << " threads";
  }
}

TEST(Pool, NothingToDoIsDone) {
  for (const std::ptrdiff_t count : {0, -1}) {
    parallel_for(count, 4, [](std::ptrdiff_t) { FAIL() << "no item was asked for"; });
  }
}

TEST(Pool, ResultsDoNotDependOnTheNumberOfThreads) {
  const auto run = [](int threads) {
    std::vector<double> out(500);
    parallel_for(500, threads, [&](std::ptrdiff_t i) {
      Random random(3, static_cast<std::uint64_t>(i));
      double sum = 0.0;
      for (int k = 0; k < 50; ++k) sum += random.normal();
      out[static_cast<std::size_t>(i)] = sum;
    });
    return out;
  };
  const std::vector<double> one = run(1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(run(threads), one);
}

// Item 2 fails only after item 3 has: the lower index still wins.
TEST(Pool, TheExceptionOfTheLowestIndexIsThrown) {
  std::atomic<bool> later_failed{false};
  try {
    parallel_for(4, 2, [&](std::ptrdiff_t i) {
      if (i == 3) {
        later_failed = true;
        throw Error(Fault::kData, "", "item 3");
      }
      if (i == 2) {
        while (!later_failed) std::this_thread::yield();
        // Long enough for the other thread to record its exception first.
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        throw Error(Fault::kData, "", "item 2");
      }
    });
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "item 2");
  }
}

TEST(Pool, AFailureStopsTheRest) {
  std::atomic<int> started{0};
  EXPECT_THROW(parallel_for(100000, 1,
                            [&](std::ptrdiff_t i) {
                              ++started;
                              if (i == 5) throw Error(Fault::kData, "", "stop");
                            }),
               Error);
  EXPECT_EQ(started.load(), 6);
}

TEST(Pool, ACancelledTokenStopsIt) {
  for (const int threads : {1, 3}) {
    Token token;
    std::atomic<int> started{0};
    try {
      parallel_for(
          1000000, threads,
          [&](std::ptrdiff_t) {
            if (++started == 10) token.cancel();
          },
          &token);
      FAIL() << "the call was not cancelled";
    } catch (const Error& error) {
      EXPECT_EQ(error.fault(), Fault::kCancelled);
      EXPECT_LT(started.load(), 1000000);
    }
  }
}

TEST(Token, StepTellsProgressAndThrowsOnceCancelled) {
  step(nullptr, 0.5);  // a null token never cancels
  Token token;
  EXPECT_EQ(token.progress(), 0.0);
  step(&token, 0.25);
  EXPECT_EQ(token.progress(), 0.25);
  EXPECT_FALSE(token.cancelled());
  token.cancel();
  EXPECT_TRUE(token.cancelled());
  try {
    step(&token, 0.5);
    FAIL() << "a cancelled token must stop the call";
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kCancelled);
    EXPECT_EQ(error.argument(), "token");
  }
}

TEST(Token, ProgressOfAPoolGrowsWithItsItems) {
  Token token;
  double before = -1.0;
  parallel_for(
      10, 1,
      [&](std::ptrdiff_t i) {
        EXPECT_GT(token.progress(), before);
        before = token.progress();
        EXPECT_NEAR(before, 0.1 * static_cast<double>(i), 1e-15);
      },
      &token);
}

}  // namespace
}  // namespace ulna
