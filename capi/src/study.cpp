#include <ulna/study.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "guard.hpp"
#include "handles.hpp"
#include "study.hpp"
#include "study/distribution.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

Vector column(const ulna_view* view, const char* argument) {
  const StridedMap map = map_view(view, argument);
  require(map.cols() == 1, argument, std::string(argument) + " must have one column");
  return map;
}

Distribution distribution_of(int32_t family, const ulna_view* parameters) {
  const Matrix p = map_view(parameters, "parameters");
  const auto need = [&p](Index count) {
    require(p.rows() == count && p.cols() == 1, "parameters",
            "this distribution has " + std::to_string(count) + " parameters, in one column");
  };
  switch (family) {
    case ULNA_FACTOR_UNIFORM:
      need(2);
      return Distribution::uniform(p(0), p(1));
    case ULNA_FACTOR_NORMAL:
      need(2);
      return Distribution::normal(p(0), p(1));
    case ULNA_FACTOR_TRUNCATED_NORMAL:
      need(4);
      return Distribution::truncated_normal(p(0), p(1), p(2), p(3));
    case ULNA_FACTOR_TRIANGULAR:
      need(3);
      return Distribution::triangular(p(0), p(1), p(2));
    case ULNA_FACTOR_LOG_UNIFORM:
      need(2);
      return Distribution::log_uniform(p(0), p(1));
    case ULNA_FACTOR_DISCRETE: {
      require(p.cols() == 1 || p.cols() == 2, "parameters",
              "a discrete distribution has a column of values and perhaps one of weights");
      std::vector<double> values(p.col(0).begin(), p.col(0).end());
      std::vector<double> weights;
      if (p.cols() == 2) weights.assign(p.col(1).begin(), p.col(1).end());
      return Distribution::discrete(std::move(values), std::move(weights));
    }
    default:
      throw Error(Fault::kArgument, "family", "family must be an ULNA_FACTOR_ constant");
  }
}

template <class Function>
void map_column(const ulna_view* in, const char* argument, double* out, int64_t capacity,
                int64_t* out_count, Function&& function) {
  Vector values = column(in, argument);
  for (double& v : values) v = function(v);
  write_array(values.data(), values.size(), out, capacity, out_count);
}

// The constant's place in a list; the core's enumerators are in the order of the constants.
template <class Enumerator>
Enumerator one_of(int32_t value, std::initializer_list<Enumerator> list, const char* argument) {
  require(value >= 0 && value < static_cast<int32_t>(list.size()), argument,
          std::string(argument) + " must be one of the constants of its group");
  return list.begin()[value];
}

SamplingSpec sampling_spec(const ulna_sampling_options* given) {
  const ulna_sampling_options o = read_options(given, "options");
  SamplingSpec out;
  out.scheme =
      one_of(o.scheme, {Scheme::kSaltelli, Scheme::kRadial, Scheme::kTrajectories, Scheme::kSample},
             "scheme");
  out.sampler = one_of(
      o.sampler, {Sampler::kSobol, Sampler::kLatin, Sampler::kMonteCarlo, Sampler::kPooledLatin},
      "sampler");
  out.factors = o.factors;
  require(o.factors >= 1 && o.factors <= 100000, "factors", "factors must be from 1 to 100000");
  if (o.groups != nullptr) out.group_of.assign(o.groups, o.groups + o.factors);
  out.n = o.n;
  if (o.replicates != 0) out.replicates = o.replicates;
  if (o.levels != 0) out.levels = o.levels;
  if (o.candidates != 0) out.candidates = o.candidates;
  if (o.guard != 0.0 || out.sampler == Sampler::kPooledLatin) {
    out.guard = o.guard < 0.0 ? 0.0 : o.guard;  // NaN stays, and is refused
  }
  out.second_order = o.second_order != 0;
  out.seed = static_cast<std::uint64_t>(o.seed);
  return out;
}

IndexSpec index_spec(const ulna_indices_options* given) {
  const ulna_indices_options o = read_options(given, "options");
  IndexSpec out;
  out.estimator = one_of(o.estimator,
                         {IndexEstimator::kDefault, IndexEstimator::kJanon,
                          IndexEstimator::kMartinez, IndexEstimator::kParity},
                         "estimator");
  out.on_failure =
      one_of(o.on_failure,
             {OnFailure::kError, OnFailure::kDropBlock, OnFailure::kNearest, OnFailure::kSurface},
             "on_failure");
  out.interval.kind = one_of(o.interval,
                             {IntervalKind::kPercentile, IntervalKind::kBca,
                              IntervalKind::kReplicates, IntervalKind::kNone},
                             "interval");
  if (o.level != 0.0) out.interval.level = o.level;
  if (o.resamples != 0) out.interval.resamples = o.resamples;
  out.interval.seed = static_cast<std::uint64_t>(o.seed);
  out.interval.threads = o.threads;
  out.blocks = o.blocks;
  out.subset = o.random != 0 ? Subset::kRandom : Subset::kPrefix;
  return out;
}

using Analysis = Indices (*)(const Sampling&, const VectorRef&, const std::vector<std::int32_t>&,
                             const IndexSpec&, Token*);

std::unique_ptr<ulna_indices> analysed(Analysis analysis, const ulna_sampling* sampling,
                                       const ulna_view* y, const int32_t* status,
                                       const ulna_indices_options* options, ulna_token* token) {
  const Sampling& design = *deref(sampling, "sampling").sampling;
  const Vector outputs = column(y, "y");
  std::vector<std::int32_t> codes;
  if (status != nullptr) codes.assign(status, status + outputs.size());
  return std::make_unique<ulna_indices>(
      ulna_indices{analysis(design, outputs, codes, index_spec(options), token_of(token)),
                   design.independent_steps()});
}

const Estimates& estimates_of(const Indices& i, int32_t which) {
  const Estimates* const all[] = {&i.first,       &i.total,    &i.second,        &i.dummy_first,
                                  &i.dummy_total, &i.mu,       &i.mu_star,       &i.sigma,
                                  &i.mean,        &i.variance, &i.failure_first, &i.failure_total};
  require(which >= ULNA_INDEX_FIRST && which <= ULNA_INDEX_FAILURE_TOTAL, "which",
          "which must be an ULNA_INDEX_ constant");
  return *all[which];
}

}  // namespace

ulna_status ulna_factor_quantile(int32_t family, const ulna_view* parameters,
                                 const ulna_view* probability, double* out, int64_t capacity,
                                 int64_t* out_count) {
  return guarded([&] {
    const Distribution distribution = distribution_of(family, parameters);
    map_column(probability, "probability", out, capacity, out_count,
               [&](double p) { return distribution.quantile(p); });
  });
}

ulna_status ulna_factor_probability(int32_t family, const ulna_view* parameters,
                                    const ulna_view* value, double* out, int64_t capacity,
                                    int64_t* out_count) {
  return guarded([&] {
    const Distribution distribution = distribution_of(family, parameters);
    map_column(value, "value", out, capacity, out_count,
               [&](double x) { return distribution.probability(x); });
  });
}

ulna_status ulna_sampling_new(const ulna_sampling_options* options, ulna_token* token,
                              ulna_sampling** out_sampling) {
  return guarded([&] {
    ulna_sampling*& out = deref(out_sampling, "out_sampling");
    auto handle = std::make_unique<ulna_sampling>(
        ulna_sampling{std::make_shared<const Sampling>(sampling_spec(options), token_of(token))});
    out = handle.release();
  });
}

ulna_status ulna_sampling_given(const ulna_sampling_options* options, const ulna_view* points,
                                ulna_sampling** out_sampling) {
  return guarded([&] {
    ulna_sampling*& out = deref(out_sampling, "out_sampling");
    const SamplingSpec spec = sampling_spec(options);
    auto handle = std::make_unique<ulna_sampling>(ulna_sampling{
        points == nullptr
            ? std::make_shared<const Sampling>(Sampling::layout(spec))
            : std::make_shared<const Sampling>(spec, PointRows(map_view(points, "points")))});
    out = handle.release();
  });
}

void ulna_sampling_free(ulna_sampling* sampling) { delete sampling; }

ulna_status ulna_sampling_get_info(const ulna_sampling* sampling, ulna_sampling_info* out_info) {
  return guarded([&] {
    const Sampling& design = *deref(sampling, "sampling").sampling;
    ulna_sampling_info info = {};
    info.rows = design.rows();
    info.blocks = design.blocks();
    info.block_rows = design.block_rows();
    info.factors = design.spec().factors;
    info.groups = design.groups();
    info.independent_steps = design.independent_steps() ? 1 : 0;
    info.has_points = design.has_points() ? 1 : 0;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_sampling_get_rows(const ulna_sampling* sampling, int64_t first, int64_t count,
                                   double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Sampling& design = *deref(sampling, "sampling").sampling;
    require(first >= 0 && count >= 0 && first <= design.rows() && count <= design.rows() - first,
            "count", "rows must be from 0 to " + std::to_string(design.rows() - 1));
    const Index size = count * design.spec().factors;
    if (study_count_only(size, out, capacity, out_count)) return;
    design.fill(first, Eigen::Map<PointRows>(out, count, design.spec().factors));
    *out_count = size;
  });
}

ulna_status ulna_sampling_get_moves(const ulna_sampling* sampling, int64_t block, int64_t* out,
                                    int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Sampling& design = *deref(sampling, "sampling").sampling;
    require(block >= 0 && block < design.blocks(), "block",
            "block must be from 0 to " + std::to_string(design.blocks() - 1));
    const std::vector<Index> moves = moved_groups(design, block);
    const auto size = static_cast<int64_t>(moves.size());
    if (study_count_only(size, out, capacity, out_count)) return;
    std::copy(moves.begin(), moves.end(), out);
    *out_count = size;
  });
}

ulna_status ulna_indices_of_variance(const ulna_sampling* sampling, const ulna_view* y,
                                     const int32_t* status, const ulna_indices_options* options,
                                     ulna_token* token, ulna_indices** out_indices) {
  return guarded([&] {
    ulna_indices*& out = deref(out_indices, "out_indices");
    out = analysed(variance_indices, sampling, y, status, options, token).release();
  });
}

ulna_status ulna_indices_of_effects(const ulna_sampling* sampling, const ulna_view* y,
                                    const int32_t* status, const ulna_indices_options* options,
                                    ulna_token* token, ulna_indices** out_indices) {
  return guarded([&] {
    ulna_indices*& out = deref(out_indices, "out_indices");
    out = analysed(elementary_effects, sampling, y, status, options, token).release();
  });
}

void ulna_indices_free(ulna_indices* indices) { delete indices; }

ulna_status ulna_indices_get_info(const ulna_indices* indices, ulna_indices_info* out_info) {
  return guarded([&] {
    const Indices& i = deref(indices, "indices").indices;
    ulna_indices_info info = {};
    info.groups = i.groups;
    info.blocks = i.blocks;
    info.failed_rows = i.failures.rows;
    info.failed_blocks = i.failures.blocks;
    info.failed_base = i.failures.base;
    info.surface_terms = i.failures.surface_terms;
    info.surface_r2 = i.failures.surface_r2;
    info.outcome = i.outcome == IndexOutcome::kConstant ? ULNA_INDICES_CONSTANT : ULNA_INDICES_GOOD;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_indices_get_values(const ulna_indices* indices, int32_t which, int32_t field,
                                    double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const ulna_indices& handle = deref(indices, "indices");
    const Estimates& e = estimates_of(handle.indices, which);
    if (which == ULNA_INDEX_TOTAL && !handle.independent_steps) {
      throw Error(Fault::kAnalysis, "which",
                  "total indices need steps whose two points are independent: use a radial design "
                  "without a guard, or a saltelli design");
    }
    require(field >= ULNA_FIELD_VALUE && field <= ULNA_FIELD_HIGH, "field",
            "field must be an ULNA_FIELD_ constant");
    const Vector* const fields[] = {&e.value, &e.error, &e.low, &e.high};
    write_array(fields[field]->data(), fields[field]->size(), out, capacity, out_count);
  });
}

ulna_status ulna_indices_get_failures(const ulna_indices* indices, int32_t which, double* out,
                                      int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const FailureReport& report = deref(indices, "indices").indices.failures;
    require(which >= ULNA_FAILURES_BY_STATUS && which <= ULNA_FAILURES_FLIP_SHARE, "which",
            "which must be an ULNA_FAILURES_ constant");
    Vector values = report.flip_share;
    if (which != ULNA_FAILURES_FLIP_SHARE) {
      const std::vector<Index>& counts =
          which == ULNA_FAILURES_BY_STATUS ? report.by_status : report.by_group;
      values = Eigen::Map<const Eigen::Array<Index, Eigen::Dynamic, 1>>(
                   counts.data(), static_cast<Index>(counts.size()))
                   .cast<double>()
                   .matrix();
    }
    write_array(values.data(), values.size(), out, capacity, out_count);
  });
}
