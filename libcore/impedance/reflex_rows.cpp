#include "impedance/reflex_rows.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "signal/butterworth.hpp"
#include "signal/zero_phase.hpp"

namespace ulna {
namespace {

constexpr double kForgotten = 1e-5;  // of the past at the start of a trial

}  // namespace

std::vector<CascadeTrial> cascade_trials(const Prepared& prepared, const ReflexOptions& options,
                                         int side, double position_mean) {
  std::vector<CascadeTrial> out;
  const PrepareReport& report = prepared.report;
  const bool filtered = report.lowpass_order > 0;
  Sos sos;
  if (filtered) sos = butterworth_lowpass(report.lowpass_order, report.lowpass_hz, report.rate_hz);
  const auto smooth = [&](Matrix& columns) {
    if (filtered && columns.cols() > 0) {
      filter_zero_phase(sos, options.prepare.zero_phase, columns);
    }
  };
  for (const PreparedTrial& trial : prepared.trials) {
    CascadeTrial t;
    t.motion.resize(trial.rows(), 3);
    t.motion.col(0) = trial.position().col(0).array() - position_mean;
    t.motion.col(1) = trial.velocity().col(0);
    t.motion.col(2) = trial.acceleration().col(0);
    t.torque = -trial.force().col(0);
    Matrix drive = (side * t.motion.col(1).array() - options.threshold).max(0.0) * side;
    smooth(drive);
    t.drive = drive.col(0);
    t.powers.resize(trial.rows(), options.position_powers - 1);
    for (Index k = 0; k < t.powers.cols(); ++k) {
      t.powers.col(k) = t.motion.col(0).array().pow(static_cast<double>(k + 2));
    }
    smooth(t.powers);
    t.edge = std::min(report.transient_rows, trial.rows() / 10);
    out.push_back(std::move(t));
  }
  return out;
}

CascadeSample cascade_sample(const std::vector<CascadeTrial>& trials,
                             const std::vector<Span>& spans, Index back, Index ahead, Index stride,
                             Index least_rows) {
  CascadeSample out;
  out.stride = stride;
  for (const Span& span : spans) {
    const CascadeTrial& trial = trials[static_cast<std::size_t>(span.trial)];
    const Index first = std::max(span.begin, trial.edge + back);
    const Index last = std::min(span.end, trial.torque.size() - trial.edge - ahead);
    const Index count = last > first ? (last - first + stride - 1) / stride : 0;
    if (count < least_rows) continue;
    out.runs.push_back({span.trial, first, count});
    out.bounds.add(count);
  }
  return out;
}

RunOffsets::RunOffsets(const CascadeSample& sample, int drift)
    : sample_(&sample), basis_(sample.rows(), drift + 1) {
  for (std::size_t r = 0; r < sample.runs.size(); ++r) {
    const Index count = sample.runs[r].count;
    Matrix powers(count, drift + 1);
    for (Index i = 0; i < count; ++i) {
      const double t =
          count > 1 ? 2.0 * static_cast<double>(i) / static_cast<double>(count - 1) - 1.0 : 0.0;
      for (int k = 0; k <= drift; ++k) powers(i, k) = std::pow(t, k);
    }
    const Eigen::HouseholderQR<Matrix> qr(powers);
    basis_.middleRows(sample.bounds.begin[r], count) =
        qr.householderQ() * Matrix::Identity(count, drift + 1);
  }
}

void RunOffsets::remove(Matrix& columns) const {
  for (std::size_t r = 0; r < sample_->runs.size(); ++r) {
    const Index count = sample_->runs[r].count;
    Matrix part = columns.middleRows(sample_->bounds.begin[r], count);
    remove_in_run(r, part);
    columns.middleRows(sample_->bounds.begin[r], count) = part;
  }
}

void RunOffsets::remove_in_run(std::size_t run, Matrix& rows_of_run) const {
  const auto q = basis_.middleRows(sample_->bounds.begin[run], rows_of_run.rows());
  const Matrix along = q.transpose() * rows_of_run;
  rows_of_run.noalias() -= q * along;
}

Vector RunOffsets::removed(Vector column) const {
  Matrix columns = column;
  remove(columns);
  return columns.col(0);
}

Vector reflex_column(const std::vector<CascadeTrial>& trials, const CascadeSample& sample,
                     const CausalElement& element, double delay_s, double step_s) {
  Vector out(sample.rows());
  int held = -1;
  Matrix response;
  const double delay = delay_s / step_s;
  for (std::size_t r = 0; r < sample.runs.size(); ++r) {
    const auto& run = sample.runs[r];
    if (run.trial != held) {
      response =
          element_response(element, trials[static_cast<std::size_t>(run.trial)].drive, step_s);
      held = run.trial;
    }
    for (Index i = 0; i < run.count; ++i) {
      const double row = static_cast<double>(run.first + i * sample.stride) - delay;
      out[sample.bounds.begin[r] + i] = delayed_value(response, step_s, row);
    }
  }
  return out;
}

std::vector<PastRun> past_columns(const std::vector<CascadeTrial>& trials,
                                  const CascadeSample& sample, const CausalElement& element,
                                  double delay_s, double step_s) {
  // The slowest pole decides how long the past lasts.
  double slowest = element.omega;
  if (element.order == 2) {
    const double z = element.zeta;
    slowest *= z < 1.0 ? z : z - std::sqrt(z * z - 1.0);
  }
  const double lasting = -std::log(kForgotten) / slowest / step_s + delay_s / step_s;
  std::vector<PastRun> out;
  for (std::size_t r = 0; r < sample.runs.size(); ++r) {
    const auto& run = sample.runs[r];
    const CascadeTrial& trial = trials[static_cast<std::size_t>(run.trial)];
    if (static_cast<double>(run.first - trial.edge) > lasting) continue;
    const Index rows =
        std::min<Index>(trial.torque.size(), static_cast<Index>(std::min(lasting, 1e9)) + 3);
    PastRun past{r, sample.bounds.begin[r], Matrix::Zero(run.count, element.order)};
    for (int state = 0; state < element.order; ++state) {
      const Matrix free = element_free(element, std::max<Index>(rows, 2), step_s, state);
      for (Index i = 0; i < run.count; ++i) {
        const double row = static_cast<double>(run.first + i * sample.stride) - delay_s / step_s;
        if (row > static_cast<double>(free.rows() - 2)) break;
        past.columns(i, state) = delayed_value(free, step_s, row);
      }
    }
    out.push_back(std::move(past));
  }
  return out;
}

}  // namespace ulna
