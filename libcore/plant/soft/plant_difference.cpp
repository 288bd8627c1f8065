#include "plant/soft/plant_difference.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {

PlantDifference PlantDifference::between(const std::vector<PlantOutcome>& full,
                                         const std::vector<PlantOutcome>& reduced) {
  require(full.size() == reduced.size(), "reduced",
          "there are " + std::to_string(full.size()) + " outcomes of the full plant and " +
              std::to_string(reduced.size()) + " of the reduced one");
  const auto n = static_cast<Index>(full.size());
  PlantDifference d;
  for (Vector* v : {&d.k, &d.k_error, &d.d, &d.slip, &d.angle}) *v = Vector::Constant(n, kNaN);
  for (Index i = 0; i < n; ++i) {
    const PlantOutcome& f = full[static_cast<std::size_t>(i)];
    const PlantOutcome& r = reduced[static_cast<std::size_t>(i)];
    const Index rows = std::min(f.angle.size(), r.angle.size());
    const double k = r.k - f.k;
    if (!std::isfinite(k)) continue;
    ++d.samples;
    d.k[i] = k;
    d.k_error[i] = (r.k - r.k_true) - (f.k - f.k_true);
    d.d[i] = r.d - f.d;
    d.slip[i] = r.slip - f.slip;
    if (rows == 0) continue;
    d.angle[i] =
        (r.angle.head(rows) - f.angle.head(rows)).norm() / std::sqrt(static_cast<double>(rows));
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
  return d;
}

}  // namespace ulna
