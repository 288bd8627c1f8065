// Designs: the sequence against published points, strata, guards, layouts, and rows that do not
// depend on how they are asked for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "base/error.hpp"
#include "study/distribution.hpp"
#include "study/permutation.hpp"
#include "study/sampling.hpp"
#include "study/sobol_directions.hpp"
#include "study/streams.hpp"

namespace ulna {
namespace {

PointRows all(const Sampling& sampling) {
  PointRows out(sampling.rows(), sampling.spec().factors);
  sampling.fill(0, out);
  return out;
}

SamplingSpec spec_of(Scheme scheme, Sampler sampler, Index factors, Index n,
                     std::uint64_t seed = 1) {
  SamplingSpec spec;
  spec.scheme = scheme;
  spec.sampler = sampler;
  spec.factors = factors;
  spec.n = n;
  spec.seed = seed;
  return spec;
}

template <class Body>
std::string message_of(Body&& body) {
  try {
    body();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(SobolSequence, FollowsJoeAndKuo) {
  // scipy.stats.qmc.Sobol(d=512, scramble=False), whose n-th point is ours at the Gray code of n:
  // rows 1, 7 and 86 in dimensions 1, 2, 3, 50 and 512.
  SobolSequence sequence(kSobolDimensions, 0, 0, false);
  PointRows points(128, kSobolDimensions);
  sequence.fill(0, points);
  const Index dimensions[] = {0, 1, 2, 49, 511};
  const double expected[][5] = {{0.5, 0.5, 0.5, 0.5, 0.5},
                                {0.875, 0.875, 0.125, 0.875, 0.875},
                                {0.4140625, 0.2578125, 0.7734375, 0.6640625, 0.5234375}};
  const Index rows[] = {1, 7, 86};
  for (int r = 0; r < 3; ++r) {
    for (int d = 0; d < 5; ++d) {
      EXPECT_NEAR(points(rows[r], dimensions[d]), expected[r][d], 1e-15) << r << " " << d;
    }
  }
}

TEST(SobolSequence, EveryCoordinateOfAScrambleHasOnePointAStratum) {
  SobolSequence sequence(kSobolDimensions, 5, 3);
  PointRows points(256, kSobolDimensions);
  sequence.fill(0, points);
  for (Index d = 0; d < kSobolDimensions; ++d) {
    std::vector<int> hits(256, 0);
    for (Index i = 0; i < 256; ++i) ++hits[static_cast<std::size_t>(points(i, d) * 256.0)];
    EXPECT_EQ(*std::max_element(hits.begin(), hits.end()), 1) << "dimension " << d + 1;
  }
  EXPECT_GT(points.minCoeff(), 0.0);
  EXPECT_LT(points.maxCoeff(), 1.0);
}

TEST(SobolSequence, ScramblesAreUniform) {
  // One point over many scrambles: mean 1/2 and variance 1/12 within 4 standard errors.
  const Index count = 4000;
  double sum = 0.0;
  double square = 0.0;
  PointRows point(1, 3);
  for (Index r = 0; r < count; ++r) {
    SobolSequence(3, 9, static_cast<std::uint64_t>(r)).fill(17, point);
    sum += point(0, 2);
    square += point(0, 2) * point(0, 2);
  }
  const double mean = sum / count;
  EXPECT_NEAR(mean, 0.5, 4.0 * std::sqrt(1.0 / 12.0 / count));
  EXPECT_NEAR(square / count - mean * mean, 1.0 / 12.0, 4.0 * std::sqrt(1.0 / 180.0 / count));
}

TEST(Permutation, IsOneInMemoryAndBeyond) {
  for (const Index n : {Index{1}, Index{2}, Index{1000}, Permutation::kTable + 1, Index{100003}}) {
    const Permutation order(n, Random(3, 1));
    std::vector<bool> seen(static_cast<std::size_t>(n), false);
    for (Index i = 0; i < n; ++i) {
      const Index at = order(i);
      ASSERT_GE(at, 0);
      ASSERT_LT(at, n);
      ASSERT_FALSE(seen[static_cast<std::size_t>(at)]);
      seen[static_cast<std::size_t>(at)] = true;
    }
  }
}

TEST(Permutation, OfManyPlacesLooksRandom) {
  // Rank correlation of place and value: 0 within 4 standard errors, 1 / sqrt(n).
  const Index n = 200000;
  const Permutation order(n, Random(8, 2));
  double sum = 0.0;
  const double centre = 0.5 * static_cast<double>(n - 1);
  for (Index i = 0; i < n; ++i) {
    sum += (static_cast<double>(i) - centre) * (static_cast<double>(order(i)) - centre);
  }
  const double spread =
      static_cast<double>(n) * (static_cast<double>(n) * static_cast<double>(n) - 1.0) / 12.0;
  EXPECT_LT(std::abs(sum / spread), 4.0 / std::sqrt(static_cast<double>(n)));
}

TEST(Sampling, RowsAreTheSameHoweverTheyAreAskedFor) {
  for (const Scheme scheme :
       {Scheme::kSample, Scheme::kSaltelli, Scheme::kRadial, Scheme::kTrajectories}) {
    for (const Sampler sampler : {Sampler::kSobol, Sampler::kLatin, Sampler::kMonteCarlo}) {
      SamplingSpec spec = spec_of(scheme, sampler, 3, 16);
      spec.replicates = 2;
      const Sampling sampling(spec);
      const PointRows whole = all(sampling);
      for (Index first = 0; first < sampling.rows(); first += 7) {
        PointRows part(std::min<Index>(7, sampling.rows() - first), 3);
        sampling.fill(first, part);
        EXPECT_EQ(part, whole.middleRows(first, part.rows()));
      }
      EXPECT_EQ(all(Sampling(spec)), whole);
      spec.seed = 0;  // 0 is a seed
      EXPECT_NE(all(Sampling(spec)), whole);
    }
  }
}

TEST(Sampling, LatinHypercubeHitsEachStratumOnce) {
  for (const Index n : {Index{50}, Index{70000}}) {
    const PointRows points = all(Sampling(spec_of(Scheme::kSample, Sampler::kLatin, 2, n)));
    for (Index k = 0; k < 2; ++k) {
      std::set<Index> strata;
      for (Index i = 0; i < n; ++i) {
        strata.insert(static_cast<Index>(points(i, k) * static_cast<double>(n)));
      }
      EXPECT_EQ(static_cast<Index>(strata.size()), n);
    }
  }
}

double closest(const PointRows& points) {
  double out = 1e9;
  for (Index i = 1; i < points.rows(); ++i) {
    for (Index j = 0; j < i; ++j) {
      out = std::min(out, (points.row(i) - points.row(j)).norm());
    }
  }
  return out;
}

TEST(Sampling, MaximinKeepsPointsApart) {
  SamplingSpec spec = spec_of(Scheme::kSample, Sampler::kLatin, 3, 40);
  const double plain = closest(all(Sampling(spec)));
  spec.candidates = 50;
  const PointRows best = all(Sampling(spec));
  EXPECT_GT(closest(best), 1.2 * plain);
  EXPECT_EQ(all(Sampling(spec)), best);
}

TEST(Sampling, SaltelliLayoutIsThatOfSalib) {
  SamplingSpec spec = spec_of(Scheme::kSaltelli, Sampler::kMonteCarlo, 3, 4);
  spec.second_order = true;
  const Sampling sampling(spec);
  ASSERT_EQ(sampling.block_rows(), 8);
  const PointRows rows = all(sampling);
  for (Index block = 0; block < 4; ++block) {
    const auto a = rows.row(8 * block);
    const auto b = rows.row(8 * block + 7);
    for (Index g = 0; g < 3; ++g) {
      for (Index k = 0; k < 3; ++k) {
        EXPECT_EQ(rows(8 * block + 1 + g, k), k == g ? b(k) : a(k));
        EXPECT_EQ(rows(8 * block + 4 + g, k), k == g ? a(k) : b(k));
      }
    }
  }
}

TEST(Sampling, GroupsMoveTogether) {
  SamplingSpec spec = spec_of(Scheme::kRadial, Sampler::kLatin, 4, 8);
  spec.group_of = {0, 1, 0, 1};
  const Sampling sampling(spec);
  ASSERT_EQ(sampling.block_rows(), 3);
  const PointRows rows = all(sampling);
  for (Index block = 0; block < 8; ++block) {
    for (Index k = 0; k < 4; ++k) {
      for (Index g = 0; g < 2; ++g) {
        EXPECT_EQ(rows(3 * block + 1 + g, k) != rows(3 * block, k), k % 2 == g);
      }
    }
  }
}

TEST(Sampling, GuardedStepsAreLong) {
  for (const double guard : {0.25, 0.4}) {
    SamplingSpec spec = spec_of(Scheme::kRadial, Sampler::kSobol, 3, 4096);
    spec.guard = guard;
    const Sampling sampling(spec);
    EXPECT_FALSE(sampling.independent_steps());
    const PointRows rows = all(sampling);
    double shortest = 1.0;
    for (Index block = 0; block < 4096; ++block) {
      for (Index k = 0; k < 3; ++k) {
        shortest = std::min(shortest, std::abs(rows(4 * block + 1 + k, k) - rows(4 * block, k)));
      }
    }
    EXPECT_GE(shortest, guard - 1e-15);
    EXPECT_LT(shortest, guard + 0.01);
    EXPECT_GT(rows.minCoeff(), 0.0);
    EXPECT_LT(rows.maxCoeff(), 1.0);
  }
}

TEST(Sampling, ParityRadialTakesConsecutiveRowsOfOneHypercube) {
  const Index n = 25;
  SamplingSpec spec = spec_of(Scheme::kRadial, Sampler::kPooledLatin, 2, n);
  // A guard would move the second point of a pair out of its stratum.
  EXPECT_THROW(Sampling{spec}, Error);
  spec.guard = 0.0;
  const PointRows rows = all(Sampling(spec));
  for (Index k = 0; k < 2; ++k) {
    std::set<Index> strata;  // of both points of every pair: 2 n rows of one hypercube
    for (Index block = 0; block < n; ++block) {
      strata.insert(static_cast<Index>(rows(3 * block, k) * 2.0 * n));
      strata.insert(static_cast<Index>(rows(3 * block + 1 + k, k) * 2.0 * n));
    }
    EXPECT_EQ(strata.size(), 2U * n);
  }
}

TEST(Sampling, TrajectoriesWalkTheGrid) {
  SamplingSpec spec = spec_of(Scheme::kTrajectories, Sampler::kMonteCarlo, 5, 200);
  spec.levels = 6;
  const PointRows rows = all(Sampling(spec));
  std::set<long> levels;
  std::vector<int> ups(5, 0);
  for (Index block = 0; block < 200; ++block) {
    std::vector<bool> moved(5, false);
    for (Index r = 1; r < 6; ++r) {
      for (Index k = 0; k < 5; ++k) {
        const double d = rows(6 * block + r, k) - rows(6 * block + r - 1, k);
        levels.insert(std::lround(rows(6 * block + r, k) * 5.0));
        if (d == 0.0) continue;
        EXPECT_NEAR(std::abs(d), 0.6, 1e-15);  // p / (2 (p - 1))
        EXPECT_FALSE(moved[static_cast<std::size_t>(k)]);
        moved[static_cast<std::size_t>(k)] = true;
        ups[static_cast<std::size_t>(k)] += d > 0.0 ? 1 : 0;
      }
    }
    EXPECT_EQ(std::count(moved.begin(), moved.end(), true), 5);
  }
  EXPECT_EQ(levels.size(), 6U);
  for (const int up : ups) EXPECT_NEAR(up, 100, 4.0 * std::sqrt(50.0));
}

TEST(Sampling, BadSpecificationsAreRefusedWithWhatToDo) {
  EXPECT_NE(message_of([] {
              Sampling(spec_of(Scheme::kSaltelli, Sampler::kSobol, 3, 1000));
            }).find("take 512 or 1024"),
            std::string::npos);
  EXPECT_NE(message_of([] {
              Sampling(spec_of(Scheme::kSaltelli, Sampler::kSobol, 300, 16));
            }).find("512 dimensions"),
            std::string::npos);
  const auto bad = [](auto&& change) {
    SamplingSpec spec = spec_of(Scheme::kRadial, Sampler::kLatin, 3, 8);
    change(spec);
    EXPECT_THROW(Sampling{spec}, Error);
  };
  bad([](SamplingSpec& s) { s.factors = 0; });
  bad([](SamplingSpec& s) { s.n = 0; });
  bad([](SamplingSpec& s) { s.n = Index{1} << 50; });
  bad([](SamplingSpec& s) { s.replicates = 0; });
  bad([](SamplingSpec& s) { s.guard = 0.5; });
  bad([](SamplingSpec& s) { s.guard = std::nan(""); });
  bad([](SamplingSpec& s) { s.group_of = {0, 1}; });
  bad([](SamplingSpec& s) { s.group_of = {0, 2, 2}; });
  bad([](SamplingSpec& s) { s.group_of = {0, -1, 1}; });
  bad([](SamplingSpec& s) { s.second_order = true; });
  bad([](SamplingSpec& s) { s.candidates = 0; });
  bad([](SamplingSpec& s) {
    s.candidates = 2;
    s.sampler = Sampler::kMonteCarlo;
  });
  bad([](SamplingSpec& s) {
    s.scheme = Scheme::kTrajectories;
    s.levels = 5;
  });
  bad([](SamplingSpec& s) {
    s.scheme = Scheme::kSample;
    s.sampler = Sampler::kPooledLatin;
  });
  const Sampling good(spec_of(Scheme::kSample, Sampler::kLatin, 3, 8));
  PointRows out(3, 3);
  EXPECT_THROW(good.fill(6, out), Error);
  EXPECT_THROW(good.fill(-1, out), Error);
}

TEST(Sampling, GivenPointsAreChecked) {
  SamplingSpec spec = spec_of(Scheme::kTrajectories, Sampler::kMonteCarlo, 3, 5);
  const PointRows rows = all(Sampling(spec));
  EXPECT_EQ(all(Sampling(spec, rows)), rows);
  PointRows stays = rows;
  stays.row(1) = stays.row(0);
  EXPECT_NE(message_of([&] { Sampling(spec, stays); }).find("row 1 "), std::string::npos);
  PointRows outside = rows;
  outside(3, 1) = 1.5;
  EXPECT_THROW(Sampling(spec, outside), Error);
  EXPECT_THROW(Sampling(spec, PointRows(rows.topRows(7))), Error);
  EXPECT_THROW(Sampling(spec, PointRows(rows.leftCols(2))), Error);
}

TEST(Sampling, AMaximinSearchCanBeCancelled) {
  SamplingSpec spec = spec_of(Scheme::kSample, Sampler::kLatin, 3, 2000);
  spec.candidates = 1000;
  Token token;
  token.cancel();
  EXPECT_THROW(Sampling(spec, &token), Error);
}

TEST(Distribution, QuantilesAgainstScipy) {
  EXPECT_EQ(Distribution::uniform(2.0, 4.0).quantile(0.25), 2.5);
  EXPECT_EQ(Distribution::uniform(2.0, 4.0).quantile(1.0), 4.0);
  // scipy.stats 1.x: norm, truncnorm, triang, loguniform .ppf
  EXPECT_NEAR(Distribution::normal(1.0, 2.0).quantile(1e-9), -10.995614030015374, 1e-12);
  EXPECT_NEAR(Distribution::normal(1.0, 2.0).quantile(0.975), 4.919927969080108, 1e-13);
  EXPECT_NEAR(Distribution::truncated_normal(0.0, 1.0, 6.0, 9.0).quantile(0.5), 6.111565061795188,
              1e-10);
  EXPECT_NEAR(Distribution::truncated_normal(1.0, 2.0, -1.0, 2.0).quantile(0.3),
              0.056190653544135216, 1e-12);
  EXPECT_NEAR(Distribution::triangular(1.0, 2.0, 5.0).quantile(0.1), 1.632455532033676, 1e-14);
  EXPECT_NEAR(Distribution::triangular(1.0, 2.0, 5.0).quantile(0.9), 3.904554884989668, 1e-14);
  EXPECT_NEAR(Distribution::log_uniform(0.1, 10.0).quantile(0.5), 1.0, 1e-15);
}

TEST(Distribution, ProbabilityIsTheInverse) {
  const Distribution all[] = {Distribution::uniform(-3.0, 5.0),
                              Distribution::normal(1.0, 2.0),
                              Distribution::truncated_normal(1.0, 2.0, -1.0, 2.0),
                              Distribution::truncated_normal(0.0, 1.0, 6.0, 9.0),
                              Distribution::triangular(1.0, 2.0, 5.0),
                              Distribution::triangular(1.0, 1.0, 5.0),
                              Distribution::log_uniform(0.1, 10.0)};
  for (const Distribution& d : all) {
    double before = -1e300;
    for (double p = 0.001; p < 1.0; p += 0.013) {
      const double x = d.quantile(p);
      EXPECT_GE(x, before);
      before = x;
      EXPECT_NEAR(d.probability(x), p, 1e-10);
    }
  }
}

TEST(Distribution, DiscreteValuesHaveTheirWeights) {
  const Distribution d = Distribution::discrete({3.0, -1.0, 7.0}, {1.0, 0.0, 3.0});
  EXPECT_EQ(d.quantile(0.0), 3.0);
  EXPECT_EQ(d.quantile(0.2499), 3.0);
  EXPECT_EQ(d.quantile(0.2501), 7.0);
  EXPECT_EQ(d.quantile(1.0), 7.0);
  EXPECT_EQ(d.quantile(d.probability(3.0)), 3.0);
  EXPECT_EQ(d.quantile(d.probability(7.0)), 7.0);
  EXPECT_THROW(d.probability(4.0), Error);
}

TEST(Distribution, BadParametersAreRefused) {
  const double inf = INFINITY;
  EXPECT_THROW(Distribution::uniform(1.0, 1.0), Error);
  EXPECT_THROW(Distribution::uniform(0.0, inf), Error);
  EXPECT_THROW(Distribution::uniform(-1.7e308, 1.7e308), Error);
  EXPECT_THROW(Distribution::normal(0.0, 0.0), Error);
  EXPECT_THROW(Distribution::normal(std::nan(""), 1.0), Error);
  EXPECT_THROW(Distribution::truncated_normal(0.0, 1.0, 50.0, 60.0), Error);
  EXPECT_THROW(Distribution::triangular(0.0, 2.0, 1.0), Error);
  EXPECT_THROW(Distribution::log_uniform(0.0, 1.0), Error);
  EXPECT_THROW(Distribution::discrete({}, {}), Error);
  EXPECT_THROW(Distribution::discrete({1.0}, {0.0}), Error);
  EXPECT_THROW(Distribution::discrete({1.0, 2.0}, {1.0}), Error);
  EXPECT_THROW(Distribution::discrete({1.0, 2.0}, {1.0, -1.0}), Error);
  EXPECT_THROW(Distribution::uniform(0.0, 1.0).quantile(1.1), Error);
  EXPECT_NE(message_of([] { Distribution::normal(0.0, 1.0).quantile(0.0); }).find("trajectories"),
            std::string::npos);
}

}  // namespace
}  // namespace ulna
