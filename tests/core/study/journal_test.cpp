// The journal: nothing that was appended is lost, nothing damaged is believed.
#include "study/journal.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <thread>

#include "base/error.hpp"

namespace ulna {
namespace {

namespace fs = std::filesystem;

class JournalTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "ulna-journal-XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }
  void TearDown() override { fs::remove_all(folder_); }

  JournalSpec spec(const std::string& writer = "main") const {
    JournalSpec out;
    out.folder = (folder_ / "study").string();
    out.plan = "{\"seed\": 1}";
    out.rows = 20;
    out.outputs = 2;
    out.writer = writer;
    return out;
  }
  fs::path file(const std::string& writer = "main") const {
    return folder_ / "study" / (writer + ".journal");
  }
  static void add(Journal& journal, Index row, std::int32_t status = 0) {
    const double values[] = {static_cast<double>(row), 0.5 * static_cast<double>(row)};
    journal.append(row, status, 0.25, values, status == 0 ? "" : "why");
  }
  void fill(Index rows, const std::string& writer = "main") const {
    Journal journal(spec(writer));
    for (Index row = 0; row < rows; ++row) add(journal, row);
  }

  fs::path folder_;
};

Index done(const Journal& journal) {
  Index out = 0;
  for (const std::int32_t s : journal.status()) out += s == kNotRun ? 0 : 1;
  return out;
}

TEST(Checksum, KnownValues) {
  // FIPS 180-4 and the vectors of the SipHash paper.
  EXPECT_EQ(hex(sha256("")), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(hex(sha256("abc")), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(hex(sha256(std::string(1000000, 'a'))),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  Digest key = {};
  std::string message;
  for (int i = 0; i < 16; ++i) key[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(i);
  for (int i = 0; i < 15; ++i) message += static_cast<char>(i);
  EXPECT_EQ(siphash(key, message.data(), message.size()), 0xa129ca6149be45e5ULL);
}

TEST_F(JournalTest, KeepsWhatItIsGiven) {
  {
    Journal journal(spec());
    add(journal, 3);
    add(journal, 7, 2);
    EXPECT_EQ(journal.status()[3], 0);
  }
  Journal again(spec());
  EXPECT_EQ(done(again), 2);
  EXPECT_EQ(again.records(), 2);
  EXPECT_EQ(again.damaged_bytes(), 0);
  EXPECT_EQ(again.values()(3, 1), 1.5);
  EXPECT_EQ(again.wall_s()[3], 0.25);
  EXPECT_TRUE(std::isnan(again.values()(0, 0)));
  EXPECT_EQ(again.status()[7], 2);
  EXPECT_EQ(again.message(7), "why");
  EXPECT_EQ(again.hash(), hex(sha256("{\"seed\": 1}")));
}

TEST_F(JournalTest, AnotherPlanIsRefused) {
  fill(3);
  JournalSpec other = spec();
  other.plan = "{\"seed\": 2}";
  EXPECT_THROW(Journal{other}, Error);
  JournalSpec rows = spec();
  rows.rows = 21;
  EXPECT_THROW(Journal{rows}, Error);
  EXPECT_EQ(done(Journal(spec())), 3);
}

TEST_F(JournalTest, EveryCutOfTheLastRecordIsSurvived) {
  fill(4);
  const auto whole = fs::file_size(file());
  const auto record = (whole - 64) / 4;
  std::ifstream in(file(), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  for (std::size_t cut = 1; cut < record; ++cut) {
    std::ofstream(file(), std::ios::binary) << bytes.substr(0, bytes.size() - cut);
    {
      Journal journal(spec());
      ASSERT_EQ(done(journal), 3) << "cut by " << cut;
      ASSERT_EQ(journal.damaged_bytes(), static_cast<Index>(record - cut));
      add(journal, 3);  // behind the torn record
    }
    ASSERT_EQ(done(Journal(spec(""))), 4) << "cut by " << cut;
  }
}

TEST_F(JournalTest, EveryFlippedBitIsNoticed) {
  fill(3);
  std::ifstream in(file(), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  for (std::size_t at = 64; at < bytes.size(); ++at) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    std::ofstream(file(), std::ios::binary) << damaged;
    Journal journal(spec(""));
    // The record is gone, the others are not.
    ASSERT_EQ(done(journal), 2) << "byte " << at;
    ASSERT_GT(journal.damaged_bytes(), 0);
  }
  std::string damaged = bytes;
  damaged[9] = static_cast<char>(damaged[9] ^ 1);
  std::ofstream(file(), std::ios::binary) << damaged;
  EXPECT_THROW(Journal(spec("")), Error);
}

TEST_F(JournalTest, AHeaderThatWasCutOffIsWrittenAgain) {
  fill(2);
  fs::resize_file(file(), 30);
  fill(2);
  EXPECT_EQ(done(Journal(spec(""))), 2);
}

TEST_F(JournalTest, WritersAddUp) {
  Journal a(spec("a"));
  Journal b(spec("b"));
  for (Index row = 0; row < 10; ++row) add(a, row);
  for (Index row = 8; row < 15; ++row) add(b, row);  // two rows twice, with the same result
  EXPECT_EQ(done(Journal(spec(""))), 15);
}

TEST_F(JournalTest, TwoResultsOfOneRowMustAgree) {
  Journal a(spec("a"));
  Journal b(spec("b"));
  add(a, 5);
  const double other[] = {5.0, std::nextafter(2.5, 3.0)};
  b.append(5, 0, 0.1, other, "");
  EXPECT_THROW(Journal(spec("")), Error);
  // In one journal at once.
  EXPECT_THROW(a.append(5, 0, 0.1, other, ""), Error);
  add(a, 5);  // the same again is no error and no record
  EXPECT_EQ(a.records(), 1);
}

TEST_F(JournalTest, TransientFailuresGiveWay) {
  constexpr std::int32_t kTimedOut = 4;
  {
    Journal a(spec("a"));
    add(a, 5, kTimedOut);
    EXPECT_TRUE(is_transient(a.status()[5]));
    add(a, 5);
    EXPECT_EQ(a.status()[5], 0);
    EXPECT_EQ(a.message(5), "");
  }
  Journal again(spec(""));
  EXPECT_EQ(again.status()[5], 0);
  EXPECT_EQ(again.records(), 2);
}

TEST_F(JournalTest, OneProcessAtATimeWrites) {
  Journal first(spec());
  try {
    Journal second(spec());
    FAIL() << "the file was opened twice";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("another process writes"), std::string::npos);
  }
  EXPECT_EQ(done(Journal(spec(""))), 0);  // reading is free
}

TEST_F(JournalTest, ThreadsMayAppend) {
  {
    Journal journal(spec());
    std::vector<std::jthread> threads;
    for (Index t = 0; t < 4; ++t) {
      threads.emplace_back([&journal, t] {
        for (Index row = t; row < 20; row += 4) add(journal, row);
      });
    }
  }
  EXPECT_EQ(done(Journal(spec(""))), 20);
}

TEST_F(JournalTest, BadCallsAreRefused) {
  JournalSpec bad = spec("../up");
  EXPECT_THROW(Journal{bad}, Error);
  bad = spec();
  bad.rows = 0;
  EXPECT_THROW(Journal{bad}, Error);
  bad = spec();
  bad.outputs = 0;
  EXPECT_THROW(Journal{bad}, Error);
  bad = spec();
  bad.folder = "/dev/null/study";
  EXPECT_THROW(Journal{bad}, Error);
  EXPECT_THROW(Journal(spec("")), Error);  // nothing to read
  fill(1);
  Journal reader(spec(""));
  EXPECT_THROW(add(reader, 1), Error);
  Journal journal(spec());
  EXPECT_THROW(add(journal, 20), Error);
  EXPECT_THROW(add(journal, -1), Error);
  EXPECT_THROW(journal.append(1, -1, 0.0, nullptr, ""), Error);
  EXPECT_THROW(journal.message(99), Error);
}

}  // namespace
}  // namespace ulna
