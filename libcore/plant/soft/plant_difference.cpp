#include "plant/soft/plant_difference.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

// Rms over the rows that both have of the distance between points, `width` columns each.
double rms_apart(const Matrix& full, const Matrix& reduced, Index width) {
  const Index rows = std::min(full.rows(), reduced.rows());
  if (rows == 0 || full.cols() == 0 || full.cols() != reduced.cols()) return kNaN;
  const auto points = static_cast<double>(rows * full.cols() / width);
  return (reduced.topRows(rows) - full.topRows(rows)).norm() / std::sqrt(points);
}

}  // namespace

PlantDifference PlantDifference::between(const std::vector<PlantOutcome>& full,
                                         const std::vector<PlantOutcome>& reduced) {
  require(full.size() == reduced.size(), "reduced",
          "there are " + std::to_string(full.size()) + " outcomes of the full plant and " +
              std::to_string(reduced.size()) + " of the reduced one");
  const auto n = static_cast<Index>(full.size());
  PlantDifference d;
  for (Vector* v : {&d.k, &d.k_error, &d.d, &d.slip, &d.angle, &d.torque, &d.displacement})
    *v = Vector::Constant(n, kNaN);
  for (Index i = 0; i < n; ++i) {
    const PlantOutcome& f = full[static_cast<std::size_t>(i)];
    const PlantOutcome& r = reduced[static_cast<std::size_t>(i)];
    const double k = r.k - f.k;
    if (!std::isfinite(k)) continue;
    ++d.samples;
    d.k[i] = k;
    d.k_error[i] = (r.k - r.k_true) - (f.k - f.k_true);
    d.d[i] = r.d - f.d;
    d.slip[i] = r.slip - f.slip;
    d.angle[i] = rms_apart(f.angle, r.angle, 1);
    d.torque[i] = rms_apart(f.torque, r.torque, 1);
    d.displacement[i] = rms_apart(f.displacement, r.displacement, 3);
  }
  const auto rms = [](const Vector& values) {
    double sum = 0.0, count = 0.0;
    for (const double v : values) {
      if (!std::isfinite(v)) continue;
      sum += v * v;
      count += 1.0;
    }
    return count > 0.0 ? std::sqrt(sum / count) : kNaN;
  };
  d.k_rms = rms(d.k);
  d.k_error_rms = rms(d.k_error);
  d.d_rms = rms(d.d);
  d.slip_rms = rms(d.slip);
  d.angle_rms = rms(d.angle);
  d.torque_rms = rms(d.torque);
  d.displacement_rms = rms(d.displacement);
  return d;
}

}  // namespace ulna
