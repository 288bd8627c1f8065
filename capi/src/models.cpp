#include <ulna/models.h>

#include <limits>
#include <memory>

#include "guard.hpp"
#include "handles.hpp"
#include "ident/rational_simulate.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

constexpr int32_t kDefaultPoles = 2;

template <class T>
std::vector<T> list_of(const T* values, int64_t count, const char* argument) {
  if (values == nullptr) return {};
  require(count >= 0, argument, std::string(argument) + " has a negative count");
  return std::vector<T>(values, values + count);
}

std::vector<Index> indices_of(const int64_t* values, int64_t count, const char* argument) {
  const std::vector<int64_t> list = list_of(values, count, argument);
  return std::vector<Index>(list.begin(), list.end());
}

Vector vector_of(const double* values, int64_t count, const char* argument) {
  const std::vector<double> list = list_of(values, count, argument);
  return Eigen::Map<const Vector>(list.data(), static_cast<Index>(list.size()));
}

Hold hold_of(int32_t hold) {
  require(hold == ULNA_HOLD_ZERO || hold == ULNA_HOLD_LINEAR, "hold",
          "hold must be ULNA_HOLD_ZERO or ULNA_HOLD_LINEAR");
  return hold == ULNA_HOLD_ZERO ? Hold::kZero : Hold::kLinear;
}

RationalOrders orders_of(const ulna_model_options& o, Index inputs) {
  RationalOrders orders;
  orders.poles = o.poles == 0 ? kDefaultPoles : o.poles;
  orders.zeros = indices_of(o.zeros, o.zero_count, "zeros");
  orders.delay_s = list_of(o.delay_s, o.delay_count, "delay_s");
  if (o.zeros == nullptr) orders.zeros.assign(static_cast<std::size_t>(inputs), orders.poles - 1);
  if (o.delay_s == nullptr) orders.delay_s.assign(static_cast<std::size_t>(inputs), 0.0);
  return orders;
}

RationalOptions options_of(const ulna_model_options& o, Index inputs) {
  RationalOptions out;
  out.setup.orders = orders_of(o, inputs);
  out.setup.hold = hold_of(o.hold);
  out.setup.rest = o.rest != 0;
  out.setup.offset = o.no_offset == 0;
  out.setup.held_out = o.held_out;
  out.setup.least_skip_s = o.skip_s;
  require(o.method == ULNA_MODEL_SRIVC || o.method == ULNA_MODEL_OUTPUT_ERROR, "method",
          "method must be ULNA_MODEL_SRIVC or ULNA_MODEL_OUTPUT_ERROR");
  out.method = o.method == ULNA_MODEL_SRIVC ? FitMethod::kInstrumental : FitMethod::kOutputError;
  if (o.bound_count != 0) {
    out.lower = vector_of(o.lower, o.bound_count, "lower");
    out.upper = vector_of(o.upper, o.bound_count, "upper");
  }
  out.cutoffs_hz = list_of(o.cutoffs_hz, o.cutoff_count, "cutoffs_hz");
  if (o.tolerance != 0.0) out.tolerance = o.tolerance;
  if (o.max_iterations != 0) out.max_iterations = o.max_iterations;
  out.refit = o.no_refit == 0;
  out.white = o.white != 0;
  return out;
}

std::vector<RowRange> ranges_of(const ulna_model_options& o) {
  const std::vector<int64_t> rows =
      list_of(o.ranges, o.range_count < 0 ? -1 : 2 * o.range_count, "ranges");
  std::vector<RowRange> out;
  for (std::size_t i = 0; i + 1 < rows.size(); i += 2) out.push_back({rows[i], rows[i + 1]});
  return out;
}

Vector output_of(const ulna_view* output) {
  const StridedMap map = map_view(output, "output");
  require(map.cols() == 1, "output",
          "the output must be one signal, got " + std::to_string(map.cols()) + " columns");
  return map.col(0);
}

OrderGrid grid_of(const ulna_order_grid& g) {
  OrderGrid out;
  out.poles = indices_of(g.poles, g.pole_count, "poles");
  if (g.poles == nullptr) out.poles = {1, 2, 3, 4};
  out.zeros = indices_of(g.zeros, g.zero_count, "zeros");
  require(g.zeros == nullptr || !out.zeros.empty(), "zeros", "zeros must name at least one number");
  out.delay_s = list_of(g.delay_s, g.delay_count, "delay_s");
  if (g.delay_s == nullptr) out.delay_s = {0.0};
  return out;
}

OrderCriterion criterion_of(int32_t criterion) {
  switch (criterion) {
    case ULNA_ORDER_HELD_OUT:
      return OrderCriterion::kHeldOut;
    case ULNA_ORDER_BIC:
      return OrderCriterion::kBic;
    case ULNA_ORDER_AICC:
      return OrderCriterion::kAicc;
    case ULNA_ORDER_YIC:
      return OrderCriterion::kYic;
    default:
      throw Error(Fault::kArgument, "criterion", "criterion must be an ULNA_ORDER_ constant");
  }
}

int32_t outcome_constant(FitOutcome outcome) {
  switch (outcome) {
    case FitOutcome::kGood:
      break;
    case FitOutcome::kNotConverged:
      return ULNA_MODEL_NOT_CONVERGED;
    case FitOutcome::kUnstable:
      return ULNA_MODEL_UNSTABLE;
    case FitOutcome::kIllConditioned:
      return ULNA_MODEL_ILL_CONDITIONED;
    case FitOutcome::kUnexplained:
      return ULNA_MODEL_UNEXPLAINED;
  }
  return ULNA_MODEL_GOOD;
}

ulna_model_info info_of(const RationalFit& fit) {
  ulna_model_info out = {};
  out.coefficients = fit.theta.size();
  out.inputs = fit.setup.orders.inputs();
  out.runs = fit.nuisance.rows();
  out.rows = fit.rows;
  out.held_out_rows = fit.held_out_rows;
  out.condition = fit.condition;
  out.sse = fit.sse;
  out.noise_variance = fit.noise_variance;
  out.vaf = fit.vaf;
  out.vaf_held_out = fit.vaf_held_out;
  out.aic = fit.aic;
  out.aicc = fit.aicc;
  out.bic = fit.bic;
  out.yic = fit.yic;
  out.poles = static_cast<int32_t>(fit.setup.orders.poles);
  out.outcome = outcome_constant(fit.outcome);
  out.iterations = fit.iterations;
  out.refitted = fit.refitted ? 1 : 0;
  return out;
}

Vector values_of(const RationalFit& fit, int32_t which) {
  switch (which) {
    case ULNA_MODEL_COEFFICIENTS:
      return fit.theta;
    case ULNA_MODEL_COVARIANCE:
      return fit.covariance.reshaped();
    case ULNA_MODEL_STATE:
      return Eigen::Map<const Eigen::VectorXi>(fit.state.data(), fit.theta.size()).cast<double>();
    case ULNA_MODEL_INITIAL:
      return fit.nuisance.transpose().reshaped();
    case ULNA_MODEL_NOISE:
      return fit.noise.ar;
    case ULNA_MODEL_SIMULATED:
      return fit.simulated;
    case ULNA_MODEL_OUTPUT_ERRORS:
      return fit.output_error;
    case ULNA_MODEL_VALIDATION_ERRORS:
      return fit.validation_error;
    default:
      throw Error(Fault::kArgument, "which",
                  "which must be from ULNA_MODEL_COEFFICIENTS to ULNA_MODEL_VALIDATION_ERRORS");
  }
}

Rational model_of(const Vector& coefficients, const RationalOrders& orders) {
  for (const Index m : orders.zeros) {
    require(m >= 0 && m <= orders.poles, "zeros", "zeros must be from 0 to the number of poles");
  }
  require(coefficients.size() == orders.parameters(), "coefficients",
          "there are " + std::to_string(coefficients.size()) + " coefficients; the orders need " +
              std::to_string(orders.parameters()));
  require(coefficients.allFinite(), "coefficients", "coefficients must be finite");
  Rational model{coefficients.head(orders.poles), {}};
  Index next = orders.poles;
  for (const Index m : orders.zeros) {
    model.b.push_back(coefficients.segment(next, m + 1));
    next += m + 1;
  }
  return model;
}

ulna_order_candidate candidate_of(const OrderCandidate& c) {
  ulna_order_candidate out = {};
  out.delay_s = c.delay_s;
  const double none = std::numeric_limits<double>::quiet_NaN();
  out.vaf = c.failed ? none : c.fit.vaf;
  out.vaf_held_out = c.failed ? none : c.fit.vaf_held_out;
  out.aicc = c.failed ? none : c.fit.aicc;
  out.bic = c.failed ? none : c.fit.bic;
  out.yic = c.failed ? none : c.fit.yic;
  out.condition = c.failed ? none : c.fit.condition;
  out.poles = static_cast<int32_t>(c.poles);
  out.zeros = static_cast<int32_t>(c.zeros);
  out.outcome = c.failed ? -1 : outcome_constant(c.fit.outcome);
  return out;
}

std::string lines_of(const std::vector<std::string>& sentences) {
  std::string out;
  for (const std::string& s : sentences) out += (out.empty() ? "" : "\n") + s;
  return out;
}

}  // namespace

ulna_status ulna_model_identify(const ulna_view* inputs, const ulna_view* output, double rate_hz,
                                const ulna_model_options* options, ulna_token* token,
                                ulna_model** out_model) {
  return guarded([&] {
    ulna_model*& out = deref(out_model, "out_model");
    const ulna_model_options o = read_options(options, "options");
    const Matrix u = map_view(inputs, "inputs");
    auto handle = std::make_unique<ulna_model>(ulna_model{identify_rational(
        u, output_of(output), rate_hz, ranges_of(o), options_of(o, u.cols()), token_of(token))});
    out = handle.release();
  });
}

void ulna_model_free(ulna_model* model) { delete model; }

ulna_status ulna_model_get_info(const ulna_model* model, ulna_model_info* out_info) {
  return guarded([&] { write_result(out_info, info_of(deref(model, "model").fit), "out_info"); });
}

ulna_status ulna_model_get_values(const ulna_model* model, int32_t which, double* out,
                                  int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Vector values = values_of(deref(model, "model").fit, which);
    write_array(values.data(), values.size(), out, capacity, out_count);
  });
}

ulna_status ulna_model_get_text(const ulna_model* model, char* out_text, int64_t capacity,
                                int64_t* out_size) {
  return guarded(
      [&] { write_text(lines_of(deref(model, "model").fit.notes), out_text, capacity, out_size); });
}

ulna_status ulna_model_simulate(const ulna_view* coefficients, const ulna_model_options* options,
                                const ulna_view* inputs, double rate_hz, double* out,
                                int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const ulna_model_options o = read_options(options, "options");
    const Matrix u = map_view(inputs, "inputs");
    const RationalOrders orders = orders_of(o, u.cols());
    const Matrix theta = map_view(coefficients, "coefficients");
    const Vector y = simulate_rational(model_of(theta.reshaped(), orders), orders.delay_s,
                                       hold_of(o.hold), u, rate_hz);
    write_array(y.data(), y.size(), out, capacity, out_count);
  });
}

ulna_status ulna_order_search_new(const ulna_view* inputs, const ulna_view* output, double rate_hz,
                                  const ulna_order_grid* grid, const ulna_model_options* options,
                                  ulna_token* token, ulna_order_search** out_search) {
  return guarded([&] {
    ulna_order_search*& out = deref(out_search, "out_search");
    const ulna_order_grid g = read_options(grid, "grid");
    const ulna_model_options o = read_options(options, "options");
    const Matrix u = map_view(inputs, "inputs");
    auto handle = std::make_unique<ulna_order_search>(ulna_order_search{search_orders(
        u, output_of(output), rate_hz, ranges_of(o), grid_of(g), criterion_of(g.criterion),
        options_of(o, u.cols()), g.threads, token_of(token))});
    out = handle.release();
  });
}

void ulna_order_search_free(ulna_order_search* search) { delete search; }

ulna_status ulna_order_search_get_count(const ulna_order_search* search, int64_t* out_count,
                                        int64_t* out_recommended) {
  return guarded([&] {
    const OrderSearch& s = deref(search, "search").search;
    int64_t& count = deref(out_count, "out_count");
    deref(out_recommended, "out_recommended") = s.recommended;
    count = static_cast<int64_t>(s.candidates.size());
  });
}

ulna_status ulna_order_search_get_candidate(const ulna_order_search* search, int64_t index,
                                            ulna_order_candidate* out_candidate) {
  return guarded([&] {
    const auto& all = deref(search, "search").search.candidates;
    require(index >= 0 && index < static_cast<int64_t>(all.size()), "index",
            "index must be from 0 to " + std::to_string(all.size() - 1));
    write_result(out_candidate, candidate_of(all[static_cast<std::size_t>(index)]),
                 "out_candidate");
  });
}

ulna_status ulna_order_search_get_text(const ulna_order_search* search, int64_t index,
                                       char* out_text, int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const OrderSearch& s = deref(search, "search").search;
    require(index >= -1 && index < static_cast<int64_t>(s.candidates.size()), "index",
            "index must be from -1 to " + std::to_string(s.candidates.size() - 1));
    write_text(index < 0 ? s.reason : s.candidates[static_cast<std::size_t>(index)].note, out_text,
               capacity, out_size);
  });
}
