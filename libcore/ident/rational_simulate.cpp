#include "ident/rational_simulate.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {

Vector simulate_rational(const Rational& model, const std::vector<double>& delay_s, Hold hold,
                         MatrixRef inputs, double rate_hz) {
  const Index n = model.a.size();
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz", "rate_hz must be positive");
  require(n >= 1, "model", "the model needs at least one pole");
  require(static_cast<Index>(model.b.size()) == inputs.cols() && delay_s.size() == model.b.size(),
          "inputs",
          sentence(6, "the model has ", model.b.size(), " inputs, ", delay_s.size(),
                   " delays were given, and the data hold ", inputs.cols(), " columns"));
  for (Index c = 0; c < inputs.cols(); ++c) {
    for (Index r = 0; r < inputs.rows(); ++r) {
      if (std::isfinite(inputs(r, c))) continue;
      throw Error(
          Fault::kData, "inputs",
          sentence(12, "inputs holds a missing or infinite value at row ", r, ", channel ", c),
          sentence(12, "row ", r, ", channel ", c));
    }
  }
  // Scaled time keeps the powers of the poles near 1.
  const double omega = mean_frequency(model.a);
  Vector a(n);
  for (Index i = 0; i < n; ++i) a[i] = model.a[i] / std::pow(omega, static_cast<double>(n - i));
  Matrix f = Matrix::Zero(n, n);
  for (Index i = 0; i + 1 < n; ++i) f(i, i + 1) = 1.0;
  f.row(n - 1) = -a.transpose();

  Vector out = Vector::Zero(inputs.rows());
  for (std::size_t i = 0; i < model.b.size(); ++i) {
    require(std::isfinite(delay_s[i]) && delay_s[i] >= 0.0, "delay_s",
            "delay_s must be finite and not negative");
    require(model.b[i].size() >= 1 && model.b[i].size() <= n + 1, "model",
            "each numerator needs from 1 coefficient to one more than there are poles");
    const Delay delay = split_delay(
        std::min(delay_s[i], (1.0 + static_cast<double>(out.size())) / rate_hz), rate_hz);
    const Step d = discretise(f, Vector::Unit(n, n - 1), omega / rate_hz, delay.fraction, hold);
    const Eigen::Vector2d weights = value_weights(delay.fraction, hold);
    Vector b = Vector::Zero(n + 1);
    for (Index j = 0; j < model.b[i].size(); ++j) {
      b[j] = model.b[i][j] / std::pow(omega, static_cast<double>(n - j));
    }
    const Vector c = b.head(n) - b[n] * a;
    const auto u = inputs.col(static_cast<Index>(i));
    const auto at = [&](Index k) { return k < 0 ? 0.0 : u[std::min(k, u.size() - 1)]; };
    Vector s = Vector::Zero(n);
    for (Index k = 0; k < out.size(); ++k) {
      const Eigen::Vector3d taps(at(k - delay.samples - 1), at(k - delay.samples),
                                 at(k - delay.samples + 1));
      out[k] += c.dot(s) + b[n] * weights.dot(taps.head<2>());
      s = d.phi * s + d.gamma * taps;
    }
  }
  return out;
}

}  // namespace ulna
