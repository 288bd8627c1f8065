#include <ulna/reflex.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "guard.hpp"
#include "handles.hpp"
#include "ident.hpp"
#include "stats/distributions.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

template <class Enum>
Enum choice(int32_t value, int32_t last, const char* argument) {
  require(value >= 0 && value <= last, argument,
          std::string(argument) + " must be one of its constants, 0 to " + std::to_string(last));
  return static_cast<Enum>(value);
}

void set(double value, double& field) {
  if (value != 0.0) field = value;
}

ReflexOptions reflex_options(const ulna_reflex_options* given) {
  const ulna_reflex_options o = read_options(given, "options");
  const PrepareRequest request = prepare_request(o.prepare);
  ReflexOptions out;
  out.prepare = request.options;
  out.position = request.position;
  out.force = request.force;
  out.intrinsic = choice<Intrinsic>(o.intrinsic, ULNA_INTRINSIC_IMPULSE_RESPONSE, "intrinsic");
  out.refit = choice<Refit>(o.refit, ULNA_REFIT_NO, "refit");
  out.side = o.side;
  if (o.order != 0) out.order = o.order;
  if (o.position_powers != 0) out.position_powers = o.position_powers;
  out.drift = o.drift;
  out.threshold = o.threshold;
  out.delay_min_s = o.delay_min_s;
  set(o.delay_max_s, out.delay_max_s);
  set(o.intrinsic_irf_s, out.intrinsic_irf_s);
  set(o.reflex_irf_s, out.reflex_irf_s);
  if (out.reflex_irf_s < 0.0) out.reflex_irf_s = 0.0;
  out.train_s = o.train_s;
  set(o.lag_s, out.hac_lag_s);
  set(o.block_s, out.block_s);
  set(o.level, out.level);
  set(o.poor_vaf, out.poor_vaf);
  if (o.draws != 0) out.draws = o.draws;
  out.seed = static_cast<std::uint64_t>(o.seed);
  out.threads = o.threads != 0 ? o.threads : request.threads;
  return out;
}

DelayedOptions delayed_options(const ulna_delayed_options* given) {
  const ulna_delayed_options o = read_options(given, "options");
  const PrepareRequest request = prepare_request(o.prepare);
  DelayedOptions out;
  out.prepare = request.options;
  out.position = request.position;
  out.force = request.force;
  out.reference = request.reference;
  out.estimator = choice<EstimatorChoice>(o.estimator, ULNA_ESTIMATOR_INSTRUMENTAL, "estimator");
  out.refit = choice<Refit>(o.refit, ULNA_REFIT_NO, "refit");
  set(o.delay_min_s, out.delay_min_s);
  if (out.delay_min_s < 0.0) out.delay_min_s = 0.0;
  set(o.delay_max_s, out.delay_max_s);
  out.train_s = o.train_s;
  set(o.lag_s, out.hac_lag_s);
  set(o.block_s, out.block_s);
  set(o.level, out.level);
  set(o.condition_limit, out.condition_limit);
  set(o.poor_vaf, out.poor_vaf);
  if (o.draws != 0) out.draws = o.draws;
  out.seed = static_cast<std::uint64_t>(o.seed);
  out.threads = o.threads != 0 ? o.threads : request.threads;
  return out;
}

WindowOptions window_options(const ulna_windows_options* given) {
  const ulna_windows_options o = read_options(given, "options");
  const PrepareRequest request = prepare_request(o.prepare);
  WindowOptions out;
  out.prepare = request.options;
  out.position = request.position;
  out.force = request.force;
  out.reference = request.reference;
  out.estimator = choice<EstimatorChoice>(o.estimator, ULNA_ESTIMATOR_INSTRUMENTAL, "estimator");
  out.free_inertia = o.free_inertia != 0;
  set(o.window_s, out.window_s);
  set(o.after_s, out.after_s);
  set(o.baseline_s, out.baseline_s);
  set(o.condition_limit, out.condition_limit);
  set(o.level, out.level);
  if (o.onsets_s != nullptr) {
    const StridedMap times = map_view(o.onsets_s, "onsets_s");
    require(times.cols() == 1 && times.rows() > 0, "onsets_s",
            "onsets_s must be one column of times, at least one");
    for (Index i = 0; i < times.rows(); ++i) out.onsets_s.push_back(times(i, 0));
  }
  if (o.draws != 0) out.draws = o.draws;
  out.seed = static_cast<std::uint64_t>(o.seed);
  out.threads = o.threads != 0 ? o.threads : request.threads;
  return out;
}

Matrix row_of(const Vector& values) { return values.transpose(); }

Matrix reflex_values(const ReflexEstimate& e, int32_t quantity) {
  switch (quantity) {
    case ULNA_REFLEX_PARAMETERS:
      return row_of(e.fit.value);
    case ULNA_REFLEX_COVARIANCE:
      return e.fit.covariance;
    case ULNA_REFLEX_INTERVALS:
      return e.fit.interval;
    case ULNA_REFLEX_POWERS:
      return row_of(e.fit.powers);
    case ULNA_REFLEX_POWERS_ERROR:
      return row_of(e.fit.powers_error);
    case ULNA_REFLEX_PROFILE_DELAY:
      return row_of(e.profile_delay_s);
    case ULNA_REFLEX_PROFILE_VAF:
      return row_of(e.profile_vaf);
    case ULNA_REFLEX_INTRINSIC_LAG:
      return row_of(e.impulse.intrinsic_lag_s);
    case ULNA_REFLEX_INTRINSIC_RESPONSE:
      return row_of(e.impulse.intrinsic);
    case ULNA_REFLEX_INTRINSIC_ERROR:
      return row_of(e.impulse.intrinsic_error);
    case ULNA_REFLEX_REFLEX_LAG:
      return row_of(e.impulse.reflex_lag_s);
    case ULNA_REFLEX_REFLEX_RESPONSE:
      return row_of(e.impulse.reflex);
    case ULNA_REFLEX_REFLEX_ERROR:
      return row_of(e.impulse.reflex_error);
    default:
      throw Error(Fault::kArgument, "quantity", "quantity must be an ULNA_REFLEX_ constant");
  }
}

// Matrices one after the other, each row by row.
Matrix flat(const std::vector<const Matrix*>& matrices) {
  std::vector<double> values;
  for (const Matrix* matrix : matrices) {
    for (Index i = 0; i < matrix->rows(); ++i) {
      for (Index j = 0; j < matrix->cols(); ++j) values.push_back((*matrix)(i, j));
    }
  }
  return Eigen::Map<const Eigen::RowVectorXd>(values.data(), static_cast<Index>(values.size()));
}

Matrix delayed_values(const DelayedEstimate& e, int32_t quantity) {
  switch (quantity) {
    case ULNA_DELAYED_PARAMETERS: {
      const Matrix x0 = e.x0;
      const Matrix delay = Matrix::Constant(1, 1, e.delay_s);
      return flat({&e.m, &e.b, &e.k, &e.k_delayed, &e.b_delayed, &x0, &delay});
    }
    case ULNA_DELAYED_COVARIANCE:
      return e.covariance;
    case ULNA_DELAYED_VAF:
      return row_of(e.vaf);
    case ULNA_DELAYED_VAF_WITHOUT:
      return row_of(e.vaf_without);
    case ULNA_DELAYED_PROFILE_DELAY:
      return row_of(e.profile_delay_s);
    case ULNA_DELAYED_PROFILE_STATISTIC:
      return row_of(e.profile_statistic);
    default:
      throw Error(Fault::kArgument, "quantity", "quantity must be an ULNA_DELAYED_ constant");
  }
}

Matrix window_values(const WindowComparison& e, int32_t quantity) {
  switch (quantity) {
    case ULNA_WINDOWS_EARLY:
      return flat({&e.early.m, &e.early.b, &e.early.k});
    case ULNA_WINDOWS_EARLY_COVARIANCE:
      return e.early.covariance;
    case ULNA_WINDOWS_LATE:
      return flat({&e.late.m, &e.late.b, &e.late.k});
    case ULNA_WINDOWS_LATE_COVARIANCE:
      return e.late.covariance;
    case ULNA_WINDOWS_DIFFERENCE_COVARIANCE:
      return e.difference_covariance;
    case ULNA_WINDOWS_EARLY_VAF:
      return row_of(e.early.vaf);
    case ULNA_WINDOWS_LATE_VAF:
      return row_of(e.late.vaf);
    case ULNA_WINDOWS_ONSETS:
      return Eigen::Map<const Eigen::RowVectorXd>(e.onset_time_s.data(),
                                                  static_cast<Index>(e.onset_time_s.size()));
    default:
      throw Error(Fault::kArgument, "quantity", "quantity must be an ULNA_WINDOWS_ constant");
  }
}

void write_matrix(const Matrix& values, double* out, int64_t capacity, int64_t* out_count) {
  const Matrix by_row = values.transpose();
  write_array(by_row.data(), by_row.size(), out, capacity, out_count);
}

std::string words(const std::vector<std::string>& warnings, const std::vector<std::string>& notes,
                  const std::vector<std::string>& provenance, const std::vector<std::string>& axes,
                  int32_t which) {
  const std::vector<std::string>* const texts[] = {&warnings, &notes, &provenance, &axes};
  require(which >= ULNA_TEXT_WARNINGS && which <= ULNA_TEXT_AXES, "which",
          "which must be an ULNA_TEXT_ constant");
  std::string all;
  for (const std::string& text : *texts[which]) all += (all.empty() ? "" : "\n") + text;
  return all;
}

template <class Estimate>
ulna_prepare_report report_of(const Estimate& e) {
  return prepare_report(e.report, e.consistency);
}

ulna_reflex_info reflex_info(const ReflexEstimate& e) {
  ulna_reflex_info out = {};
  out.outcome = e.outcome;
  out.rotational = e.rotational ? 1 : 0;
  out.side = e.side;
  out.refitted = e.refitted ? 1 : 0;
  out.p_value = e.p_value;
  out.vaf = e.vaf;
  std::copy_n(e.vaf_interval, 2, out.vaf_interval);
  out.vaf_intrinsic = e.vaf_intrinsic;
  out.vaf_reflex = e.vaf_reflex;
  out.vaf_without = e.vaf_without;
  std::copy_n(e.gain_interval, 2, out.gain_interval);
  out.vaf_train = e.vaf_train;
  out.vaf_train_without = e.vaf_train_without;
  out.vaf_train_other = e.vaf_train_other;
  out.vaf_impulse = e.impulse.vaf;
  out.impulse_penalty = e.impulse.penalty;
  out.position_mean = e.fit.position_mean;
  out.train_s = e.train_s;
  out.train_rows = e.train_rows;
  out.held_out_rows = e.held_out_rows;
  out.test_blocks = e.test_blocks;
  out.trials = static_cast<int64_t>(e.signals.size());
  return out;
}

}  // namespace

ulna_status ulna_reflex_identify(const ulna_record* record, const ulna_reflex_options* options,
                                 ulna_token* token, ulna_reflex** out_reflex) {
  return guarded([&] {
    ulna_reflex*& out = deref(out_reflex, "out_reflex");
    auto handle = std::make_unique<ulna_reflex>(ulna_reflex{
        identify_reflex(deref(record, "record").record, reflex_options(options), token_of(token))});
    out = handle.release();
  });
}

void ulna_reflex_free(ulna_reflex* reflex) { delete reflex; }

ulna_status ulna_reflex_get_info(const ulna_reflex* reflex, ulna_reflex_info* out_info) {
  return guarded(
      [&] { write_result(out_info, reflex_info(deref(reflex, "reflex").estimate), "out_info"); });
}

ulna_status ulna_reflex_get_preparation(const ulna_reflex* reflex,
                                        ulna_prepare_report* out_report) {
  return guarded(
      [&] { write_result(out_report, report_of(deref(reflex, "reflex").estimate), "out_report"); });
}

ulna_status ulna_reflex_get_values(const ulna_reflex* reflex, int32_t quantity, double* out,
                                   int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    write_matrix(reflex_values(deref(reflex, "reflex").estimate, quantity), out, capacity,
                 out_count);
  });
}

ulna_status ulna_reflex_get_signals(const ulna_reflex* reflex, int64_t trial, int32_t signal,
                                    double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const ReflexEstimate& e = deref(reflex, "reflex").estimate;
    const auto trials = static_cast<int64_t>(e.signals.size());
    require(trial >= 0 && trial < trials, "trial",
            "trial must be from 0 to " + std::to_string(trials - 1));
    require(signal >= ULNA_REFLEX_SIGNAL_TIME && signal <= ULNA_REFLEX_SIGNAL_USE, "signal",
            "signal must be an ULNA_REFLEX_SIGNAL_ constant");
    const Matrix& values = e.signals[static_cast<std::size_t>(trial)];
    write_array(values.col(signal).data(), values.rows(), out, capacity, out_count);
  });
}

ulna_status ulna_reflex_get_text(const ulna_reflex* reflex, int32_t which, char* out_text,
                                 int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const ReflexEstimate& e = deref(reflex, "reflex").estimate;
    write_text(words(e.warnings, e.notes, e.provenance, {e.axis}, which), out_text, capacity,
               out_size);
  });
}

ulna_status ulna_delayed_identify(const ulna_record* record, const ulna_delayed_options* options,
                                  ulna_token* token, ulna_delayed** out_delayed) {
  return guarded([&] {
    ulna_delayed*& out = deref(out_delayed, "out_delayed");
    auto handle = std::make_unique<ulna_delayed>(ulna_delayed{identify_delayed(
        deref(record, "record").record, delayed_options(options), token_of(token))});
    out = handle.release();
  });
}

void ulna_delayed_free(ulna_delayed* delayed) { delete delayed; }

ulna_status ulna_delayed_get_info(const ulna_delayed* delayed, ulna_delayed_info* out_info) {
  return guarded([&] {
    const DelayedEstimate& e = deref(delayed, "delayed").estimate;
    ulna_delayed_info info = {};
    info.axes = static_cast<int32_t>(e.n);
    info.rotational = e.rotational ? 1 : 0;
    info.outcome = e.outcome;
    info.estimator = e.estimator == Estimator::kInstrumental ? ULNA_ESTIMATOR_INSTRUMENTAL
                                                             : ULNA_ESTIMATOR_LEAST_SQUARES;
    info.refitted = e.refitted ? 1 : 0;
    info.delay_s = e.delay_s;
    std::copy_n(e.delay_interval, 2, info.delay_interval);
    info.p_value = e.p_value;
    info.condition = e.condition;
    info.train_rows = e.train_rows;
    info.held_out_rows = e.held_out_rows;
    info.test_blocks = e.test_blocks;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_delayed_get_preparation(const ulna_delayed* delayed,
                                         ulna_prepare_report* out_report) {
  return guarded([&] {
    write_result(out_report, report_of(deref(delayed, "delayed").estimate), "out_report");
  });
}

ulna_status ulna_delayed_get_values(const ulna_delayed* delayed, int32_t quantity, double* out,
                                    int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    write_matrix(delayed_values(deref(delayed, "delayed").estimate, quantity), out, capacity,
                 out_count);
  });
}

ulna_status ulna_delayed_get_text(const ulna_delayed* delayed, int32_t which, char* out_text,
                                  int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const DelayedEstimate& e = deref(delayed, "delayed").estimate;
    write_text(words(e.warnings, e.notes, e.provenance, e.axes, which), out_text, capacity,
               out_size);
  });
}

ulna_status ulna_windows_compare(const ulna_record* record, const ulna_windows_options* options,
                                 ulna_token* token, ulna_windows** out_windows) {
  return guarded([&] {
    ulna_windows*& out = deref(out_windows, "out_windows");
    auto handle = std::make_unique<ulna_windows>(ulna_windows{
        compare_windows(deref(record, "record").record, window_options(options), token_of(token))});
    out = handle.release();
  });
}

void ulna_windows_free(ulna_windows* windows) { delete windows; }

ulna_status ulna_windows_get_info(const ulna_windows* windows, ulna_windows_info* out_info) {
  return guarded([&] {
    const WindowComparison& e = deref(windows, "windows").comparison;
    ulna_windows_info info = {};
    info.axes = static_cast<int32_t>(e.n);
    info.rotational = e.rotational ? 1 : 0;
    info.outcome = e.outcome;
    info.estimator = e.estimator == Estimator::kInstrumental ? ULNA_ESTIMATOR_INSTRUMENTAL
                                                             : ULNA_ESTIMATOR_LEAST_SQUARES;
    info.p_value = e.p_value;
    info.degrees = e.degrees;
    info.quantile = student_quantile(0.975, e.degrees);
    info.condition = e.condition;
    info.guard_s = e.guard_s;
    info.early_rows = e.early.rows;
    info.late_rows = e.late.rows;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_windows_get_preparation(const ulna_windows* windows,
                                         ulna_prepare_report* out_report) {
  return guarded([&] {
    write_result(out_report, report_of(deref(windows, "windows").comparison), "out_report");
  });
}

ulna_status ulna_windows_get_values(const ulna_windows* windows, int32_t quantity, double* out,
                                    int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    write_matrix(window_values(deref(windows, "windows").comparison, quantity), out, capacity,
                 out_count);
  });
}

ulna_status ulna_windows_get_text(const ulna_windows* windows, int32_t which, char* out_text,
                                  int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const WindowComparison& e = deref(windows, "windows").comparison;
    write_text(words(e.warnings, e.notes, e.provenance, e.axes, which), out_text, capacity,
               out_size);
  });
}
