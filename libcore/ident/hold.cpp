#include "ident/hold.hpp"

#include <Eigen/LU>
#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

namespace ulna {
namespace {

// Responses over time h to a constant input and to one that rises at slope 1 from zero, from one
// exponential (Van Loan 1978).
struct Interval {
  Matrix phi;
  Vector constant;
  Vector ramp;
};

Interval integrate(const Matrix& f, const Vector& g, double h) {
  const Index n = f.rows();
  Matrix m = Matrix::Zero(n + 2, n + 2);
  m.topLeftCorner(n, n) = f * h;
  m.block(0, n, n, 1) = g * h;
  m(n, n + 1) = h;
  if (!m.allFinite()) {
    return {Matrix::Constant(n, n, NAN), Vector::Constant(n, NAN), Vector::Constant(n, NAN)};
  }
  const Matrix e = m.exp();
  return {e.topLeftCorner(n, n), e.block(0, n, n, 1), e.block(0, n + 1, n, 1)};
}

}  // namespace

Delay split_delay(double delay_s, double rate_hz) {
  const double samples = delay_s * rate_hz;
  const double whole = std::floor(samples + 1e-9);
  const double rest = samples - whole;
  return {static_cast<Index>(whole), rest < 1e-9 ? 0.0 : rest};
}

Step discretise(const Matrix& f, const Vector& g, double step, double fraction, Hold hold) {
  // From t[k] the delayed input still moves from u[k-d-1] to u[k-d] for a time of fraction * step,
  // then from u[k-d] to u[k-d+1].
  const double late = (1.0 - fraction) * step;
  const Interval second = integrate(f, g, late);
  Step out{second.phi, Matrix::Zero(f.rows(), 3)};
  const bool linear = hold == Hold::kLinear;
  out.gamma.col(1) = second.constant;
  if (linear) {
    out.gamma.col(1) -= second.ramp / step;
    out.gamma.col(2) = second.ramp / step;
  }
  if (fraction == 0.0) return out;
  const Interval first = integrate(f, g, fraction * step);
  out.phi = second.phi * first.phi;
  if (linear) {  // starts at u[k-d-1] + (1 - fraction)(u[k-d] - u[k-d-1])
    out.gamma.col(0) = second.phi * (fraction * first.constant - first.ramp / step);
    out.gamma.col(1) += second.phi * ((1.0 - fraction) * first.constant + first.ramp / step);
  } else {
    out.gamma.col(0) = second.phi * first.constant;
  }
  return out;
}

Eigen::Vector2d value_weights(double fraction, Hold hold) {
  if (fraction == 0.0) return {0.0, 1.0};
  if (hold == Hold::kZero) return {1.0, 0.0};
  return {fraction, 1.0 - fraction};
}

}  // namespace ulna
