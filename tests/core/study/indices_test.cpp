// Indices against closed forms: unbiased over many designs, with errors that are what they say.
#include "study/indices.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "functions.hpp"
#include "study/failures.hpp"

namespace ulna {
namespace {

Indices indices_of(const KnownFunction& f, const SamplingSpec& spec, const IndexSpec& analysis) {
  const Sampling sampling(spec);
  return variance_indices(sampling, run(sampling, f.value), {}, analysis);
}

IndexSpec without_interval(IndexEstimator estimator = IndexEstimator::kDefault) {
  IndexSpec spec;
  spec.estimator = estimator;
  spec.interval.kind = IntervalKind::kNone;
  return spec;
}

TEST(VarianceIndices, AreUnbiasedOverManyDesigns) {
  // The mean over 200 designs within 3 of its own standard errors (4 for the largest of the 120
  // indices looked at: a chance of 1 in 130 for a sound estimator, and the seeds are fixed), and a
  // ratio's bias of the order 1 / n.
  constexpr int kDesigns = 200;
  constexpr Index kBlocks = 256;
  int looked = 0;
  int beyond = 0;
  for (const KnownFunction& f : known_functions()) {
    for (const Sampler sampler : {Sampler::kMonteCarlo, Sampler::kLatin, Sampler::kSobol}) {
      Matrix first(kDesigns, f.factors);
      Matrix total(kDesigns, f.factors);
      for (int seed = 0; seed < kDesigns; ++seed) {
        const Indices i = indices_of(f,
                                     study_of(Scheme::kSaltelli, sampler, f.factors, kBlocks,
                                              static_cast<std::uint64_t>(seed)),
                                     without_interval());
        first.row(seed) = i.first.value.transpose();
        total.row(seed) = i.total.value.transpose();
      }
      const auto compare = [&](const Matrix& estimates, const Vector& exact, const char* kind) {
        for (Index k = 0; k < f.factors; ++k) {
          const double mean = estimates.col(k).mean();
          const double spread = std::sqrt((estimates.col(k).array() - mean).square().sum() /
                                          (kDesigns - 1.0) / kDesigns);
          const double miss = std::abs(mean - exact[k]);
          // 1 / n: the bias of a ratio with a variance estimated from the same points.
          const double bias = 3.0 / kBlocks * (exact[k] + 0.01);
          ++looked;
          if (miss > 3.0 * spread + bias) ++beyond;
          EXPECT_LE(miss, 4.0 * spread + bias) << f.name << " " << kind << " " << k;
        }
      };
      compare(first, f.first, "first");
      compare(total, f.total, "total");
    }
  }
  EXPECT_LE(beyond, looked / 100);  // 0.27 % are expected
}

TEST(VarianceIndices, AllEstimatorsAgreeOnALargeDesign) {
  const KnownFunction f = ishigami();
  for (const IndexEstimator estimator : {IndexEstimator::kDefault, IndexEstimator::kJanon,
                                         IndexEstimator::kMartinez, IndexEstimator::kParity}) {
    const Indices i = indices_of(f, study_of(Scheme::kSaltelli, Sampler::kSobol, 3, 1 << 15, 7),
                                 without_interval(estimator));
    // 32768 scrambled points: the spread over scrambles is 0.002.
    EXPECT_LT((i.first.value - f.first).cwiseAbs().maxCoeff(), 0.01);
    EXPECT_LT((i.total.value - f.total).cwiseAbs().maxCoeff(), 0.01);
    EXPECT_NEAR(i.mean.value[0], 3.5, 0.01);
    EXPECT_NEAR(i.variance.value[0], 13.8445879407193, 0.05);
  }
}

TEST(VarianceIndices, SecondOrderOfAProduct) {
  // x1 x2 on (0, 1): S = 3/7, 3/7, S12 = 1/7; a third factor does nothing.
  KnownFunction f;
  f.factors = 3;
  f.value = [](const double* u) { return u[0] * u[1]; };
  SamplingSpec spec = study_of(Scheme::kSaltelli, Sampler::kSobol, 3, 1 << 14, 3);
  spec.second_order = true;
  const Indices i = indices_of(f, spec, without_interval());
  EXPECT_NEAR(i.first.value[0], 3.0 / 7.0, 2e-3);
  EXPECT_NEAR(i.second.value[0], 1.0 / 7.0, 5e-3);
  EXPECT_NEAR(i.second.value[1], 0.0, 5e-3);
  EXPECT_NEAR(i.second.value[2], 0.0, 5e-3);
  EXPECT_EQ(i.total.value[2], 0.0);
  EXPECT_EQ(i.first.value[2], 0.0);
}

TEST(VarianceIndices, GroupsHaveTheirClosedIndex) {
  // Ishigami, {x1, x3} and {x2}: nothing interacts across, so first and total are the same.
  SamplingSpec spec = study_of(Scheme::kSaltelli, Sampler::kSobol, 3, 1 << 14, 3);
  spec.group_of = {0, 1, 0};
  const Indices i = indices_of(ishigami(), spec, without_interval());
  ASSERT_EQ(i.groups, 2);
  EXPECT_NEAR(i.first.value[0], 0.557588855210, 0.01);
  EXPECT_NEAR(i.total.value[0], 0.557588855210, 0.01);
  EXPECT_NEAR(i.first.value[1], 0.442411144790, 0.01);
}

TEST(VarianceIndices, AMeanOfAMillionChangesNothing) {
  const KnownFunction f = ishigami();
  const Sampling sampling(study_of(Scheme::kSaltelli, Sampler::kSobol, 3, 1024, 5));
  const Vector y = run(sampling, f.value);
  const Vector raised = y.array() + 1e6;
  for (const IndexEstimator estimator :
       {IndexEstimator::kDefault, IndexEstimator::kJanon, IndexEstimator::kMartinez}) {
    const Indices a = variance_indices(sampling, y, {}, without_interval(estimator));
    const Indices b = variance_indices(sampling, raised, {}, without_interval(estimator));
    EXPECT_LT((a.first.value - b.first.value).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((a.total.value - b.total.value).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_NEAR(b.mean.value[0] - 1e6, a.mean.value[0], 1e-8);
  }
  // The uncentred pair does not survive it: this is what it is kept to show.
  const Indices c =
      variance_indices(sampling, raised, {}, without_interval(IndexEstimator::kParity));
  EXPECT_GT((c.first.value - f.first).cwiseAbs().maxCoeff(), 1.0);
}

TEST(VarianceIndices, ParityIsWhatSafeComputes) {
  // vbsa_indices of SAFE: f0 = mean(YA), V = mean(YA^2) - f0^2, S = (mean(YA YC) - f0^2) / V,
  // T = 1 - (mean(YB YC) - f0^2) / V with C_i = B except for column i, which is from A.
  const KnownFunction f = bratley();
  const Index n = 200;
  const Sampling sampling(study_of(Scheme::kSaltelli, Sampler::kPooledLatin, 6, n, 2));
  const Vector y = run(sampling, f.value);
  const Indices i = variance_indices(sampling, y, {}, without_interval(IndexEstimator::kParity));
  for (Index g = 0; g < 6; ++g) {
    double f0 = 0.0;
    double square = 0.0;
    double ac = 0.0;
    double bc = 0.0;
    for (Index b = 0; b < n; ++b) {
      const double ya = y[8 * b + 7];  // SAFE's A is our B
      const double yb = y[8 * b];
      const double yc = y[8 * b + 1 + g];
      f0 += ya / n;
      square += ya * ya / n;
      ac += ya * yc / n;
      bc += yb * yc / n;
    }
    const double variance = square - f0 * f0;
    EXPECT_NEAR(i.first.value[g], (ac - f0 * f0) / variance, 1e-12);
    EXPECT_NEAR(i.total.value[g], 1.0 - (bc - f0 * f0) / variance, 1e-12);
  }
}

TEST(VarianceIndices, ConstantOutputsAreSaidToBe) {
  const Sampling sampling(study_of(Scheme::kSaltelli, Sampler::kSobol, 3, 64, 1));
  for (const double value : {0.0, 1e6, -3.25}) {
    const Indices i = variance_indices(sampling, Vector::Constant(sampling.rows(), value), {}, {});
    EXPECT_EQ(i.outcome, IndexOutcome::kConstant);
    EXPECT_TRUE(i.first.value.array().isNaN().all());
    EXPECT_TRUE(i.total.low.array().isNaN().all());
    EXPECT_EQ(i.mean.value[0], value);
  }
  // Constant but for rounding is constant.
  Vector y = Vector::Constant(sampling.rows(), 1e6);
  y[5] = std::nextafter(1e6, 2e6);
  EXPECT_EQ(variance_indices(sampling, y, {}, {}).outcome, IndexOutcome::kConstant);
}

TEST(VarianceIndices, OneFactorHasAllOfTheVariance) {
  KnownFunction f;
  f.factors = 1;
  f.value = [](const double* u) { return std::exp(u[0]); };
  const Indices i = indices_of(f, study_of(Scheme::kSaltelli, Sampler::kSobol, 1, 1024, 1), {});
  EXPECT_EQ(i.outcome, IndexOutcome::kGood);
  EXPECT_NEAR(i.first.value[0], 1.0, 0.01);
  EXPECT_NEAR(i.total.value[0], 1.0, 0.01);
  EXPECT_LT(i.first.low[0], 1.0);
  EXPECT_GT(i.first.high[0], 1.0);
}

TEST(VarianceIndices, DoNotDependOnThreads) {
  const KnownFunction f = ishigami();
  const Sampling sampling(study_of(Scheme::kSaltelli, Sampler::kLatin, 3, 3000, 1));
  const Vector y = run(sampling, f.value);
  IndexSpec spec;
  spec.interval.resamples = 200;
  spec.interval.threads = 1;
  const Indices one = variance_indices(sampling, y, {}, spec);
  spec.interval.threads = 3;
  const Indices three = variance_indices(sampling, y, {}, spec);
  EXPECT_EQ(one.first.low, three.first.low);
  EXPECT_EQ(one.total.high, three.total.high);
  EXPECT_EQ(one.total.error, three.total.error);
}

TEST(VarianceIndices, SubsetsArePrefixesOrRandom) {
  const KnownFunction f = ishigami();
  const SamplingSpec half = study_of(Scheme::kSaltelli, Sampler::kSobol, 3, 512, 4);
  SamplingSpec full = half;
  full.n = 1024;
  const Sampling sampling(full);
  const Vector y = run(sampling, f.value);
  IndexSpec spec = without_interval();
  spec.blocks = 512;
  // The sequence's prefix is the smaller design itself.
  EXPECT_EQ(variance_indices(sampling, y, {}, spec).total.value,
            indices_of(f, half, without_interval()).total.value);
  spec.subset = Subset::kRandom;
  const Indices random = variance_indices(sampling, y, {}, spec);
  EXPECT_EQ(random.blocks, 512);
  EXPECT_NE(random.total.value, indices_of(f, half, without_interval()).total.value);
  spec.blocks = 2000;
  EXPECT_THROW(variance_indices(sampling, y, {}, spec), Error);
}

struct Share {
  double value = 0.0;
  double error = 0.0;  // standard error: from the spread of the designs' own shares
};

// Share of intervals that hold the exact value, over all indices that vary. The indices of one
// design err together, so it is designs that are counted.
Share coverage(const KnownFunction& f, Sampler sampler, IntervalKind kind, Index n, int designs,
               Index replicates = 1) {
  Vector shares(designs);
  for (int seed = 0; seed < designs; ++seed) {
    int hit = 0;
    int looked = 0;
    SamplingSpec spec =
        study_of(Scheme::kSaltelli, sampler, f.factors, n, static_cast<std::uint64_t>(1000 + seed));
    spec.replicates = replicates;
    IndexSpec analysis;
    analysis.interval.kind = kind;
    analysis.interval.resamples = 300;
    analysis.interval.seed = static_cast<std::uint64_t>(seed);
    const Indices i = indices_of(f, spec, analysis);
    for (Index k = 0; k < f.factors; ++k) {
      if (f.total[k] == 0.0) continue;  // no error at all
      hit += i.first.low[k] <= f.first[k] && f.first[k] <= i.first.high[k] ? 1 : 0;
      hit += i.total.low[k] <= f.total[k] && f.total[k] <= i.total.high[k] ? 1 : 0;
      looked += 2;
    }
    shares[seed] = static_cast<double>(hit) / looked;
  }
  const double mean = shares.mean();
  return {mean, std::sqrt((shares.array() - mean).square().sum() / (designs * (designs - 1.0)))};
}

TEST(VarianceIndices, NinetyPercentIntervalsHoldNinetyPercent) {
  // Of 60 designs the share is known to 1.5 to 4 %, which is what is allowed beyond 86 and 94 %
  // twice; the long test of 200 larger designs allows nothing. The worst is Bratley's function,
  // 0.875 to 0.885 over 300 designs of this size: its least total index, 0.006, is skewed.
  for (const KnownFunction& f : {ishigami(), sobol_g({0.0, 0.5, 3.0, 9.0}), bratley()}) {
    for (const Sampler sampler : {Sampler::kMonteCarlo, Sampler::kLatin}) {
      for (const IntervalKind kind : {IntervalKind::kPercentile, IntervalKind::kBca}) {
        const Share share = coverage(f, sampler, kind, 512, 60);
        EXPECT_LT(share.error, 0.04) << f.name;
        EXPECT_GT(share.value + 2.0 * share.error, 0.86) << f.name;
        EXPECT_LT(share.value - 2.0 * share.error, 0.94) << f.name;
      }
    }
  }
}

TEST(VarianceIndices, ReplicatesShowTheErrorOfASequence) {
  // The spread of scrambles is the error of the sequence; a bootstrap does not see how even it is.
  const Share replicates =
      coverage(ishigami(), Sampler::kSobol, IntervalKind::kReplicates, 128, 100, 8);
  EXPECT_GT(replicates.value, 0.86);
  EXPECT_LT(replicates.value, 0.94);
  EXPECT_GT(coverage(ishigami(), Sampler::kSobol, IntervalKind::kPercentile, 1024, 60).value, 0.93);
}

TEST(VarianceIndices, StudentsIntervalOfReplicates) {
  // Two replicates: 90 % are 6.313751514675 standard errors of one degree of freedom.
  SamplingSpec spec = study_of(Scheme::kSaltelli, Sampler::kMonteCarlo, 3, 256, 4);
  spec.replicates = 2;
  IndexSpec analysis;
  analysis.interval.kind = IntervalKind::kReplicates;
  const Indices i = indices_of(ishigami(), spec, analysis);
  EXPECT_NEAR((i.first.high[0] - i.first.value[0]) / i.first.error[0], 6.313751514675, 1e-9);
  spec.replicates = 5;
  const Indices five = indices_of(ishigami(), spec, analysis);
  EXPECT_NEAR((five.first.high[0] - five.first.value[0]) / five.first.error[0], 2.131846786327,
              1e-9);
  spec.replicates = 1;
  EXPECT_THROW(indices_of(ishigami(), spec, analysis), Error);
}

TEST(VarianceIndices, BadCallsAreRefused) {
  const Sampling sampling(study_of(Scheme::kSaltelli, Sampler::kSobol, 3, 16, 1));
  const Vector y = run(sampling, ishigami().value);
  EXPECT_THROW(variance_indices(sampling, y.head(10), {}, {}), Error);
  EXPECT_THROW(variance_indices(sampling, y, {0, 1}, {}), Error);
  EXPECT_THROW(
      variance_indices(sampling, y, std::vector<std::int32_t>(std::size_t(y.size()), -2), {}),
      Error);
  IndexSpec spec;
  spec.interval.level = 1.0;
  EXPECT_THROW(variance_indices(sampling, y, {}, spec), Error);
  spec = {};
  spec.interval.resamples = 10;
  EXPECT_THROW(variance_indices(sampling, y, {}, spec), Error);
  EXPECT_THROW(elementary_effects(sampling, y, {}, {}), Error);
  Vector huge = y;
  huge[0] = 1.7e308;
  huge[1] = -1.7e308;
  EXPECT_THROW(variance_indices(sampling, huge, {}, {}), Error);
  const Sampling radial(study_of(Scheme::kRadial, Sampler::kLatin, 3, 16, 1));
  EXPECT_THROW(variance_indices(radial, Vector::Zero(radial.rows()), {}, {}), Error);
  Token token;
  token.cancel();
  EXPECT_THROW(variance_indices(sampling, y, {}, {}, &token), Error);
}

// Elementary effects ------------------------------------------------------------------------------

TEST(ElementaryEffects, OfALinearFunctionAreItsCoefficients) {
  // EE_i = c_i, sigma = 0 to the rounding of y / step; large means take only what they must.
  for (const double mean : {0.0, 1e6}) {
    for (const Scheme scheme : {Scheme::kRadial, Scheme::kTrajectories}) {
      const Sampling sampling(study_of(scheme, Sampler::kLatin, 3, 32, 3));
      const Vector y = run(sampling, [mean](const double* u) {
        return mean + 2.0 * u[0] - 5.0 * u[1] + 0.001 * u[2];
      });
      const Indices i = elementary_effects(sampling, y, {}, {});
      const double rounding = 1e-14 + 1e-15 * mean;
      const Vector mu = numbers({2.0, -5.0, 0.001});
      EXPECT_LT((i.mu.value - mu).cwiseAbs().maxCoeff(), rounding);
      EXPECT_LT((i.mu_star.value - mu.cwiseAbs()).cwiseAbs().maxCoeff(), rounding);
      EXPECT_LT(i.sigma.value.maxCoeff(), rounding);
    }
  }
}

TEST(ElementaryEffects, OfGWithIndependentPairs) {
  // mu = 0, mu* = 4 ln 2 / (1 + a_i), sigma^2 = 32 (1 - ln 2) / (1 + a_i)^2 prod_{j != i} (1 +
  // V_j).
  const std::vector<double> a = {0.0, 0.5, 3.0, 9.0};
  SamplingSpec spec = study_of(Scheme::kRadial, Sampler::kMonteCarlo, 4, 1 << 15, 3);
  spec.guard = 0.0;
  const Sampling sampling(spec);
  const KnownFunction g = sobol_g(a);
  const Indices i = elementary_effects(sampling, run(sampling, g.value), {}, {});
  for (Index k = 0; k < 4; ++k) {
    const double scale = 1.0 / (1.0 + a[static_cast<std::size_t>(k)]);
    double others = 1.0;
    for (Index j = 0; j < 4; ++j) {
      const double s = 1.0 + a[static_cast<std::size_t>(j)];
      if (j != k) others *= 1.0 + 1.0 / (3.0 * s * s);
    }
    const double sigma = std::sqrt(32.0 * (1.0 - std::log(2.0)) * others) * scale;
    EXPECT_NEAR(i.mu.value[k], 0.0, 4.0 * i.mu.error[k]);
    EXPECT_NEAR(i.mu_star.value[k], 4.0 * std::log(2.0) * scale, 4.0 * i.mu_star.error[k]);
    EXPECT_NEAR(i.sigma.value[k], sigma, 4.0 * i.sigma.error[k]);
    EXPECT_NEAR(i.mu.error[k], sigma / std::sqrt(static_cast<double>(spec.n)), 0.1 * i.mu.error[k]);
    EXPECT_NEAR(i.total.value[k], g.total[k], 4.0 * i.total.error[k]);  // Jansen's
  }
}

TEST(ElementaryEffects, OfTrajectoriesOnMorrisFunction) {
  const Sampling sampling(study_of(Scheme::kTrajectories, Sampler::kMonteCarlo, 20, 4000, 5));
  const Indices i = elementary_effects(sampling, run(sampling, morris().value), {}, {});
  const double expected[] = {63.85641519, 63.85641519, 50.81852048,
                             63.85641519, 50.53937150, 43.26988399};
  for (Index k = 0; k < 6; ++k) {
    EXPECT_NEAR(i.mu_star.value[k], expected[k], 4.0 * i.mu_star.error[k]);
  }
  EXPECT_EQ(i.mu_star.value.tail(10).maxCoeff(), 0.0);
  EXPECT_EQ(i.total.value.size(), 0);  // steps on a grid depend on where they start
}

TEST(ElementaryEffects, SigmaDividesByOneLess) {
  const Sampling sampling(study_of(Scheme::kRadial, Sampler::kLatin, 2, 5, 5));
  const KnownFunction g = sobol_g({0.0, 1.0});
  const Vector y = run(sampling, g.value);
  PointRows points(sampling.rows(), 2);
  sampling.fill(0, points);
  const Indices i = elementary_effects(sampling, y, {}, {});
  for (Index k = 0; k < 2; ++k) {
    Vector effects(5);
    for (Index b = 0; b < 5; ++b) {
      effects[b] = (y[3 * b + 1 + k] - y[3 * b]) / (points(3 * b + 1 + k, k) - points(3 * b, k));
    }
    EXPECT_NEAR(i.mu.value[k], effects.mean(), 1e-13);
    EXPECT_NEAR(i.mu_star.value[k], effects.cwiseAbs().mean(), 1e-13);
    EXPECT_NEAR(i.sigma.value[k],
                std::sqrt((effects.array() - effects.mean()).square().sum() / 4.0), 1e-12);
  }
}

TEST(ElementaryEffects, GroupsHaveNoSign) {
  SamplingSpec spec = study_of(Scheme::kTrajectories, Sampler::kMonteCarlo, 3, 50, 5);
  spec.group_of = {0, 0, 1};
  const Sampling sampling(spec);
  const Indices i = elementary_effects(
      sampling, run(sampling, [](const double* u) { return u[0] + u[1] + 3.0 * u[2]; }), {}, {});
  EXPECT_TRUE(std::isnan(i.mu.value[0]));
  EXPECT_TRUE(std::isnan(i.sigma.value[0]));
  EXPECT_NEAR(i.mu.value[1], 3.0, 1e-13);
  // Both up, or one up and one down: 2 or 0.
  EXPECT_NEAR(i.mu_star.value[0], 1.0, 0.5);
}

TEST(ElementaryEffects, ConstantOutputsHaveNone) {
  SamplingSpec spec = study_of(Scheme::kRadial, Sampler::kLatin, 2, 16, 5);
  spec.guard = 0.0;
  const Sampling sampling(spec);
  const Indices i = elementary_effects(sampling, Vector::Constant(sampling.rows(), 4.0), {}, {});
  EXPECT_EQ(i.outcome, IndexOutcome::kConstant);
  EXPECT_EQ(i.mu_star.value, Vector::Zero(2));
  EXPECT_EQ(i.sigma.value, Vector::Zero(2));
  EXPECT_TRUE(i.total.value.array().isNaN().all());
}

// Failed runs -------------------------------------------------------------------------------------

struct Broken {
  Sampling sampling;
  Vector whole;
  Vector y;
  Index failed = 0;
};

// Runs fail in a corner that holds 4 % of the cube.
Broken broken(const KnownFunction& f, Sampler sampler, Index n, std::uint64_t seed) {
  Broken out{Sampling(study_of(Scheme::kSaltelli, sampler, f.factors, n, seed)), {}, {}, 0};
  out.whole = run(out.sampling, f.value);
  out.y = out.whole;
  PointRows points(out.sampling.rows(), f.factors);
  out.sampling.fill(0, points);
  for (Index i = 0; i < out.y.size(); ++i) {
    if (points(i, 0) > 0.8 && points(i, 1) > 0.8) {
      out.y[i] = kNaN;
      ++out.failed;
    }
  }
  return out;
}

// Of the outputs that were filled in, on the failed runs.
double r2_of_filled(const Broken& b, const Vector& filled) {
  double mean = 0.0;
  for (Index i = 0; i < b.y.size(); ++i) {
    if (std::isnan(b.y[i])) mean += b.whole[i] / static_cast<double>(b.failed);
  }
  double miss = 0.0;
  double spread = 0.0;
  for (Index i = 0; i < b.y.size(); ++i) {
    if (!std::isnan(b.y[i])) continue;
    miss += (filled[i] - b.whole[i]) * (filled[i] - b.whole[i]);
    spread += (b.whole[i] - mean) * (b.whole[i] - mean);
  }
  return 1.0 - miss / spread;
}

TEST(Failures, AreAnErrorUnlessToldOtherwise) {
  const Broken b = broken(ishigami(), Sampler::kSobol, 256, 1);
  try {
    variance_indices(b.sampling, b.y, {}, {});
    FAIL() << "failed runs were accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kData);
    EXPECT_NE(std::string(error.what()).find(std::to_string(b.failed) + " of 1280 runs failed"),
              std::string::npos);
  }
}

TEST(Failures, ASurfaceInACornerBiasesNoIndexByAHundredth) {
  // The difference to the indices of the same design without a failure: the bias of the treatment
  // alone. The mean over five designs.
  for (const KnownFunction& f : {ishigami(), sobol_g({0.0, 0.5, 3.0, 9.0}), bratley()}) {
    Vector first = Vector::Zero(f.factors);
    Vector total = Vector::Zero(f.factors);
    double nearest = 0.0;
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      const Broken b = broken(f, Sampler::kSobol, 1024, seed);
      EXPECT_NEAR(static_cast<double>(b.failed) / static_cast<double>(b.y.size()), 0.04, 0.005);
      const Indices whole = variance_indices(b.sampling, b.whole, {}, without_interval());
      IndexSpec spec = without_interval();
      spec.on_failure = OnFailure::kSurface;
      const Indices i = variance_indices(b.sampling, b.y, {}, spec);
      first += (i.first.value - whole.first.value) / 5.0;
      total += (i.total.value - whole.total.value) / 5.0;
      // What the report says of the surface, from the good runs beside the failed ones, holds for
      // the failed ones.
      Outputs filled = look_at_outputs(b.sampling, b.y, {});
      treat_failures(b.sampling, OnFailure::kSurface, 0, filled, nullptr);
      const double truth = r2_of_filled(b, filled.y);
      // A polynomial goes on smoothly; it cannot know how a function with kinks goes on.
      EXPECT_EQ(i.failures.surface_r2 > 0.8, f.name.find("G with") == std::string::npos) << f.name;
      EXPECT_EQ(truth > 0.8, i.failures.surface_r2 > 0.8) << f.name;
      EXPECT_NEAR(truth, i.failures.surface_r2, 0.3) << f.name;
      spec.on_failure = OnFailure::kNearest;
      const Indices n = variance_indices(b.sampling, b.y, {}, spec);
      nearest = std::max(nearest, (n.first.value - whole.first.value).cwiseAbs().maxCoeff());
    }
    EXPECT_LT(first.cwiseAbs().maxCoeff(), 0.01) << f.name;
    EXPECT_LT(total.cwiseAbs().maxCoeff(), 0.01) << f.name;
    EXPECT_LT(nearest, 0.1) << f.name;
  }
}

TEST(Failures, DroppedBlocksAreCounted) {
  const Broken b = broken(ishigami(), Sampler::kMonteCarlo, 500, 1);
  IndexSpec spec = without_interval();
  spec.on_failure = OnFailure::kDropBlock;
  const Indices i = variance_indices(b.sampling, b.y, {}, spec);
  EXPECT_EQ(i.failures.rows, b.failed);
  EXPECT_EQ(i.blocks, 500 - i.failures.blocks);
  Index blocks = 0;
  for (Index block = 0; block < 500; ++block) {
    blocks += b.y.segment(5 * block, 5).array().isNaN().any() ? 1 : 0;
  }
  EXPECT_EQ(i.failures.blocks, blocks);
  Index rows = i.failures.base;
  for (const Index count : i.failures.by_group) rows += count;
  EXPECT_EQ(rows, b.failed);
}

TEST(Failures, TheIndicatorNamesTheFactorsBehindThem) {
  const Broken b = broken(ishigami(), Sampler::kSobol, 4096, 1);
  IndexSpec spec = without_interval();
  spec.on_failure = OnFailure::kNearest;
  const Indices i = variance_indices(b.sampling, b.y, {}, spec);
  // 1{u1 > .8} 1{u2 > .8}, p = 0.2: V_1 = p^3 (1 - p), T_1 V = p^2 (1 - p), V = p^2 (1 - p^2).
  const double first = 0.2 * 0.8 / 0.96;
  const double total = 0.8 / 0.96;
  for (const Index k : {0, 1}) {
    EXPECT_NEAR(i.failure_first.value[k], first, 0.03);
    EXPECT_NEAR(i.failure_total.value[k], total, 0.03);
    EXPECT_NEAR(i.failures.flip_share[k], 2.0 * 0.04 * 0.8, 0.01);
  }
  EXPECT_EQ(i.failure_total.value[2], 0.0);
  EXPECT_EQ(i.failures.flip_share[2], 0.0);
}

TEST(Failures, StatusesAreCountedApart) {
  const Sampling sampling(study_of(Scheme::kRadial, Sampler::kLatin, 2, 20, 1));
  Vector y = run(sampling, [](const double* u) { return u[0]; });
  std::vector<std::int32_t> status(60, 0);
  status[4] = 2;
  status[7] = 4;
  status[8] = 4;
  y[30] = kInfinity;
  IndexSpec spec;
  spec.on_failure = OnFailure::kDropBlock;
  const Indices i = elementary_effects(sampling, y, status, spec);
  EXPECT_EQ(i.failures.by_status, (std::vector<Index>{1, 0, 1, 0, 2}));
  EXPECT_EQ(i.failures.blocks, 3);
  EXPECT_EQ(i.failures.base, 1);
  EXPECT_NEAR(i.mu.value[0], 1.0, 1e-13);
}

TEST(Failures, NothingLeftIsAnError) {
  const Sampling sampling(study_of(Scheme::kSaltelli, Sampler::kLatin, 2, 8, 1));
  IndexSpec spec;
  for (const OnFailure treatment :
       {OnFailure::kDropBlock, OnFailure::kNearest, OnFailure::kSurface}) {
    spec.on_failure = treatment;
    EXPECT_THROW(variance_indices(sampling, Vector::Constant(32, kNaN), {}, spec), Error);
  }
  Vector one = Vector::Constant(32, kNaN);
  one[3] = 1.0;
  spec.on_failure = OnFailure::kSurface;
  EXPECT_THROW(variance_indices(sampling, one, {}, spec), Error);
  spec.on_failure = OnFailure::kNearest;
  EXPECT_EQ(variance_indices(sampling, one, {}, spec).outcome, IndexOutcome::kConstant);
}

TEST(Failures, NearestIsNearest) {
  const Sampling sampling(study_of(Scheme::kSaltelli, Sampler::kMonteCarlo, 2, 60, 1));
  Vector y = run(sampling, sobol_g({0.0, 1.0}).value);
  PointRows points(sampling.rows(), 2);
  sampling.fill(0, points);
  std::vector<bool> lost(static_cast<std::size_t>(y.size()), false);
  Vector filled = y;
  for (Index i = 0; i < y.size(); i += 3) lost[static_cast<std::size_t>(i)] = true;
  for (Index i = 0; i < y.size(); i += 3) {
    double best = 1e9;
    for (Index j = 0; j < y.size(); ++j) {
      const double d = (points.row(i) - points.row(j)).squaredNorm();
      if (!lost[static_cast<std::size_t>(j)] && d < best) {
        best = d;
        filled[i] = y[j];
      }
    }
  }
  for (Index i = 0; i < y.size(); i += 3) y[i] = kNaN;
  IndexSpec spec = without_interval();
  spec.on_failure = OnFailure::kNearest;
  const Indices a = variance_indices(sampling, y, {}, spec);
  const Indices b = variance_indices(sampling, filled, {}, without_interval());
  EXPECT_EQ(a.total.value, b.total.value);
}

TEST(Failures, WithoutPointsOnlyBlocksCanBeDropped) {
  const Sampling made(study_of(Scheme::kSaltelli, Sampler::kMonteCarlo, 3, 100, 1));
  const Sampling layout = Sampling::layout(made.spec());
  Vector y = run(made, ishigami().value);
  EXPECT_EQ(variance_indices(layout, y, {}, {}).total.value,
            variance_indices(made, y, {}, {}).total.value);
  y[3] = kNaN;
  IndexSpec spec;
  spec.on_failure = OnFailure::kNearest;
  EXPECT_THROW(variance_indices(layout, y, {}, spec), Error);
  spec.on_failure = OnFailure::kDropBlock;
  EXPECT_EQ(variance_indices(layout, y, {}, spec).blocks, 99);
}

}  // namespace
}  // namespace ulna
