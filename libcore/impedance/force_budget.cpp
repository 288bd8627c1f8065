#include "impedance/force_budget.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "base/words.hpp"
#include "impedance/natural.hpp"
#include "signal/butterworth.hpp"
#include "signal/savgol.hpp"
#include "signal/zero_phase.hpp"

namespace ulna {

ForceBudget force_budget(const ImpedanceEstimate& estimate, const ForceErrors& errors,
                         Token* token) {
  const Index n = estimate.n;
  const Record& record = *estimate.record;
  const Index count = static_cast<Index>(errors.names.size());
  require(count > 0, "sensed",
          "nothing is known of the systematic errors of this force: give the covariance of the "
          "robot's parameters or a scale error");
  for (const Matrix& s : errors.sensitivity) {
    require(s.rows() == record.rows() && s.cols() == n, "impedance",
            sentence(6, "the impedance was identified from a record of ", record.rows(),
                     " rows and ", n, " axes, the force errors have ", s.rows(), " rows and ",
                     s.cols(), " axes: identify it from the record that the sensor gave"));
  }

  const PrepareReport& report = estimate.report;
  const Matrix kernel = savgol_kernels({report.window, report.order}, 0, report.rate_hz);
  Sos sos;
  if (report.lowpass_hz > 0.0) {
    sos = butterworth_lowpass(report.lowpass_order, report.lowpass_hz, report.rate_hz);
  }
  std::vector<Span> spans = estimate.train;
  if (estimate.refitted) {
    spans.insert(spans.end(), estimate.held_out.begin(), estimate.held_out.end());
    std::sort(spans.begin(), spans.end(), [](const Span& a, const Span& b) {
      return a.trial != b.trial ? a.trial < b.trial : a.begin < b.begin;
    });
  }

  ForceBudget out;
  out.sensitivity.resize(natural_size(n), count);
  const Matrix jacobian = natural_jacobian(estimate.fit.theta);
  const Matrix transform = structure_map(estimate.structure, n);
  for (Index k = 0; k < count; ++k) {
    step(token, static_cast<double>(k) / static_cast<double>(count));
    // The estimate's signals with this one in the place of the force, through the same smoother.
    Prepared prepared{estimate.prepared->roles, report, {}};
    for (std::size_t t = 0; t < estimate.prepared->trials.size(); ++t) {
      const PreparedTrial& trial = estimate.prepared->trials[t];
      Matrix table = trial.table();
      Matrix smooth(trial.rows(), n);
      const Trial& whole = record.trials()[t];
      for (Index i = 0; i < n; ++i) {
        savgol_correlate(kernel,
                         errors.sensitivity[static_cast<std::size_t>(k)].col(i).segment(
                             whole.begin, whole.end - whole.begin),
                         smooth.col(i));
      }
      if (report.lowpass_hz > 0.0) filter_zero_phase(sos, report.zero_phase, smooth);
      table.middleCols(3 * n, n) = smooth;
      prepared.trials.emplace_back(
          trial.begin(), n, static_cast<Index>(prepared.roles.reference.size()), std::move(table));
    }
    const Design design(prepared, 0.0, spans);
    const Fit fit = solve(factorise(design, spans, token), transform, estimate.fit.estimator);
    out.sensitivity.col(k) = jacobian * fit.theta.reshaped();
  }
  out.systematic = out.sensitivity * errors.covariance * out.sensitivity.transpose();
  out.total = out.systematic + estimate.fit.covariance;
  return out;
}

}  // namespace ulna
