#include <ulna/impedance.h>

#include <algorithm>
#include <memory>

#include "arguments.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "ident.hpp"
#include "impedance/ellipse.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

template <class Enum>
Enum choice(int32_t value, int32_t last, const char* argument) {
  require(value >= 0 && value <= last, argument,
          std::string(argument) + " must be one of its constants, 0 to " + std::to_string(last));
  return static_cast<Enum>(value);
}

ImpedanceOptions impedance_options(const ulna_impedance_options* given) {
  const ulna_impedance_options o = read_options(given, "options");
  const PrepareRequest request = prepare_request(o.prepare);
  ImpedanceOptions out;
  out.prepare = request.options;
  out.position = request.position;
  out.force = request.force;
  out.reference = request.reference;
  out.structure.model = choice<Model>(o.model, ULNA_MODEL_PASSIVE, "model");
  out.structure.no_damping = o.no_damping != 0;
  out.structure.diagonal_mass = o.diagonal_mass != 0;
  out.estimator = choice<EstimatorChoice>(o.estimator, ULNA_ESTIMATOR_INSTRUMENTAL, "estimator");
  out.errors = choice<ErrorModel>(o.errors, ULNA_ERRORS_BLOCK_BOOTSTRAP, "errors");
  out.refit = choice<Refit>(o.refit, ULNA_REFIT_NO, "refit");
  out.payload_kg = o.payload_kg;
  out.train_s = o.train_s;
  out.hac_lag_s = or_default(o.lag_s, out.hac_lag_s);
  out.block_s = or_default(o.block_s, out.block_s);
  out.condition_limit = or_default(o.condition_limit, out.condition_limit);
  out.poor_vaf = or_default(o.poor_vaf, out.poor_vaf);
  if (o.bootstrap != 0) out.bootstrap = o.bootstrap;
  if (o.draws != 0) out.draws = o.draws;
  out.seed = static_cast<std::uint64_t>(o.seed);
  out.threads = o.threads != 0 ? o.threads : request.threads;
  return out;
}

const ImpedanceFit& fit_of(const ulna_impedance* impedance, int32_t fit) {
  const ImpedanceEstimate& estimate = deref(impedance, "impedance").estimate;
  if (fit == ULNA_FIT_REPORTED) return estimate.fit;
  require(fit == ULNA_FIT_ALTERNATIVE, "fit", "fit must be ULNA_FIT_REPORTED or _ALTERNATIVE");
  require(estimate.alternative != nullptr, "fit", "the estimate has no alternative fit");
  return *estimate.alternative;
}

Matrix rows_of(const Vector& values) { return values.transpose(); }

Matrix trial_table(const ImpedanceEstimate& estimate) {
  Matrix table(static_cast<Index>(estimate.trials.size()), estimate.fit.covariance.rows());
  for (Index i = 0; i < table.rows(); ++i) {
    table.row(i) = estimate.trials[static_cast<std::size_t>(i)].natural.transpose();
  }
  return table;
}

Matrix values_of(const ImpedanceEstimate& estimate, const ImpedanceFit& fit, int32_t quantity) {
  switch (quantity) {
    case ULNA_IMPEDANCE_M:
      return fit.m;
    case ULNA_IMPEDANCE_B:
      return fit.b;
    case ULNA_IMPEDANCE_K:
      return fit.k;
    case ULNA_IMPEDANCE_X0:
      return rows_of(fit.x0);
    case ULNA_IMPEDANCE_COVARIANCE:
      return fit.covariance;
    case ULNA_IMPEDANCE_DRAWS:
      return parameter_draws(fit);
    case ULNA_IMPEDANCE_VAF:
      return rows_of(fit.vaf);
    case ULNA_IMPEDANCE_VAF_INTERVAL:
      return fit.vaf_interval;
    case ULNA_IMPEDANCE_VAF_TRAIN:
      return rows_of(fit.vaf_train);
    case ULNA_IMPEDANCE_MOTION_FREQUENCY:
      return rows_of(estimate.motion.freq_hz);
    case ULNA_IMPEDANCE_MOTION_SHARE:
      return estimate.motion.share;
    case ULNA_IMPEDANCE_MOTION_TOTAL:
      return rows_of(estimate.motion.total);
    case ULNA_IMPEDANCE_TRIALS:
      return trial_table(estimate);
    case ULNA_IMPEDANCE_TRIAL_MEAN:
      return rows_of(estimate.trial_mean);
    case ULNA_IMPEDANCE_TRIAL_ERROR:
      return rows_of(estimate.trial_error);
    case ULNA_IMPEDANCE_VAF_REFERENCE:
      return rows_of(fit.vaf_reference);
    default:
      throw Error(Fault::kArgument, "quantity", "quantity must be an ULNA_IMPEDANCE_ constant");
  }
}

Vector times_of(const ImpedanceEstimate& estimate, const PreparedTrial& trial) {
  return Eigen::Map<const Vector>(estimate.record->time().data() + trial.begin(), trial.rows());
}

Vector use_of(const ImpedanceEstimate& estimate, int trial) {
  Vector use = Vector::Zero(estimate.prepared->trials[static_cast<std::size_t>(trial)].rows());
  const auto mark = [&](const std::vector<Span>& spans, double value) {
    for (const Span& span : spans) {
      if (span.trial == trial) use.segment(span.begin, span.end - span.begin).setConstant(value);
    }
  };
  mark(estimate.train, 1.0);
  mark(estimate.held_out, 2.0);
  return use;
}

Matrix signal_of(const ImpedanceEstimate& estimate, const ImpedanceFit& fit, int trial,
                 int32_t signal) {
  const PreparedTrial& data = estimate.prepared->trials[static_cast<std::size_t>(trial)];
  switch (signal) {
    case ULNA_SIGNAL_TIME:
      return times_of(estimate, data);
    case ULNA_SIGNAL_POSITION:
      return data.position();
    case ULNA_SIGNAL_VELOCITY:
      return data.velocity();
    case ULNA_SIGNAL_ACCELERATION:
      return data.acceleration();
    case ULNA_SIGNAL_FORCE:
      return data.force();
    case ULNA_SIGNAL_FORCE_PREDICTED:
      return predict_force(estimate, fit, trial);
    case ULNA_SIGNAL_USE:
      return use_of(estimate, trial);
    default:
      throw Error(Fault::kArgument, "signal", "signal must be an ULNA_SIGNAL_ constant");
  }
}

void write_matrix(const Matrix& values, double* out, int64_t capacity, int64_t* out_count) {
  const Matrix by_row = values.transpose();
  write_array(by_row.data(), by_row.size(), out, capacity, out_count);
}

std::string lines(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) all += (all.empty() ? "" : "\n") + text;
  return all;
}

ulna_ellipse ellipse_struct(const Ellipse& e) {
  ulna_ellipse out = {};
  out.major = e.major;
  out.minor = e.minor;
  out.area = e.area;
  out.shape = e.shape;
  out.angle_rad = e.angle_rad;
  out.antisymmetric = e.antisymmetric;
  out.antisymmetry = e.antisymmetry;
  out.angle_defined = e.angle_defined ? 1 : 0;
  for (double* interval : {out.major_interval, out.minor_interval, out.area_interval,
                           out.shape_interval, out.angle_interval_rad, out.antisymmetry_interval}) {
    interval[0] = interval[1] = kNaN;
  }
  return out;
}

ulna_ellipse ellipse_struct(const EllipseInterval& e) {
  ulna_ellipse out = ellipse_struct(e.value);
  const auto copy = [](const double(&from)[2], double(&to)[2]) { std::copy_n(from, 2, to); };
  copy(e.major, out.major_interval);
  copy(e.minor, out.minor_interval);
  copy(e.area, out.area_interval);
  copy(e.shape, out.shape_interval);
  copy(e.angle_rad, out.angle_interval_rad);
  copy(e.antisymmetry, out.antisymmetry_interval);
  return out;
}

}  // namespace

ulna_status ulna_impedance_identify(const ulna_record* record,
                                    const ulna_impedance_options* options, ulna_token* token,
                                    ulna_impedance** out_impedance) {
  return guarded([&] {
    ulna_impedance*& out = deref(out_impedance, "out_impedance");
    const ulna_record& source = deref(record, "record");
    auto handle = std::make_unique<ulna_impedance>(ulna_impedance{identify_impedance(
        source.record, impedance_options(options), token_of(token), source.findings)});
    out = handle.release();
  });
}

void ulna_impedance_free(ulna_impedance* impedance) { delete impedance; }

ulna_status ulna_impedance_get_info(const ulna_impedance* impedance,
                                    ulna_impedance_info* out_info) {
  return guarded([&] {
    const ImpedanceEstimate& e = deref(impedance, "impedance").estimate;
    ulna_impedance_info info = {};
    info.axes = static_cast<int32_t>(e.n);
    info.rotational = e.rotational ? 1 : 0;
    info.fits = e.alternative ? 2 : 1;
    info.refitted = e.refitted ? 1 : 0;
    info.trials = static_cast<int64_t>(e.prepared->trials.size());
    info.train_rows = e.train_rows;
    info.held_out_rows = e.held_out_rows;
    info.train_s = e.train_s;
    info.payload_kg = e.payload_kg;
    info.lag_s = e.lag.available ? e.lag.lag_s : kNaN;
    info.lag_error_s = e.lag.available ? e.lag.standard_error_s : kNaN;
    info.difference_p = e.alternative ? e.test.p_value : kNaN;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_impedance_get_preparation(const ulna_impedance* impedance,
                                           ulna_prepare_report* out_report) {
  return guarded([&] {
    write_result(out_report, prepare_report(*deref(impedance, "impedance").estimate.prepared),
                 "out_report");
  });
}

ulna_status ulna_impedance_get_fit(const ulna_impedance* impedance, int32_t fit,
                                   ulna_fit_info* out_info) {
  return guarded([&] {
    const ImpedanceFit& f = fit_of(impedance, fit);
    ulna_fit_info info = {};
    info.estimator = f.estimator == Estimator::kInstrumental ? ULNA_ESTIMATOR_INSTRUMENTAL
                                                             : ULNA_ESTIMATOR_LEAST_SQUARES;
    info.outcome = f.outcome;
    info.constrained = f.constrained ? 1 : 0;
    info.condition = f.condition;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_impedance_get_values(const ulna_impedance* impedance, int32_t fit,
                                      int32_t quantity, double* out, int64_t capacity,
                                      int64_t* out_count) {
  return guarded([&] {
    const ImpedanceFit& f = fit_of(impedance, fit);
    write_matrix(values_of(impedance->estimate, f, quantity), out, capacity, out_count);
  });
}

ulna_status ulna_impedance_get_signals(const ulna_impedance* impedance, int32_t fit, int64_t trial,
                                       int32_t signal, double* out, int64_t capacity,
                                       int64_t* out_count) {
  return guarded([&] {
    const ImpedanceFit& f = fit_of(impedance, fit);
    const auto trials = static_cast<int64_t>(impedance->estimate.prepared->trials.size());
    require(trial >= 0 && trial < trials, "trial",
            "trial must be from 0 to " + std::to_string(trials - 1));
    write_matrix(signal_of(impedance->estimate, f, static_cast<int>(trial), signal), out, capacity,
                 out_count);
  });
}

ulna_status ulna_impedance_get_text(const ulna_impedance* impedance, int32_t which, char* out_text,
                                    int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const ImpedanceEstimate& e = deref(impedance, "impedance").estimate;
    const std::vector<std::string>* const texts[] = {&e.warnings, &e.notes, &e.provenance, &e.axes};
    require(which >= ULNA_TEXT_WARNINGS && which <= ULNA_TEXT_AXES, "which",
            "which must be an ULNA_TEXT_ constant");
    write_text(lines(*texts[which]), out_text, capacity, out_size);
  });
}

ulna_status ulna_impedance_get_ellipse(const ulna_impedance* impedance, int32_t fit,
                                       int32_t quantity, double level, ulna_ellipse* out_ellipse) {
  return guarded([&] {
    const ImpedanceFit& f = fit_of(impedance, fit);
    require(impedance->estimate.n == 2, "impedance", "an ellipse needs an impedance of two axes");
    require(quantity >= ULNA_IMPEDANCE_M && quantity <= ULNA_IMPEDANCE_K, "quantity",
            "quantity must be ULNA_IMPEDANCE_M, _B or _K");
    require(level > 0.0 && level < 1.0, "level", "the level must lie between 0 and 1");
    const Matrix draws = parameter_draws(f).middleCols(4 * quantity, 4);
    const Matrix value = values_of(impedance->estimate, f, quantity);
    write_result(out_ellipse, ellipse_struct(ellipse_interval(value, draws, level)), "out_ellipse");
  });
}

ulna_status ulna_ellipse_of(const ulna_view* matrix, ulna_ellipse* out_ellipse) {
  return guarded([&] {
    write_result(out_ellipse, ellipse_struct(ellipse_of(map_view(matrix, "matrix"))),
                 "out_ellipse");
  });
}
