#include "impedance/causal_element.hpp"

#include <array>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

// State (w, w' / omega): entries stay of the order of omega, whatever the sampling.
Matrix dynamics(const CausalElement& e) {
  if (e.order == 1) return Matrix::Constant(1, 1, -e.omega);
  Matrix a(2, 2);
  a << 0.0, e.omega, -e.omega, -2.0 * e.zeta * e.omega;
  return a;
}

// exp(m) by scaling and squaring of its series, for small matrices.
Matrix exponential(Matrix m) {
  const double norm = m.cwiseAbs().rowwise().sum().maxCoeff();
  const int halvings = norm > 0.125 ? static_cast<int>(std::ceil(std::log2(norm / 0.125))) : 0;
  m /= std::ldexp(1.0, halvings);
  Matrix term = Matrix::Identity(m.rows(), m.cols());
  Matrix sum = term;
  for (int k = 1; k <= 12; ++k) {
    term = term * m / static_cast<double>(k);
    sum += term;
  }
  for (int k = 0; k < halvings; ++k) sum = sum * sum;
  return sum;
}

struct Recursion {
  Matrix state;             // x(k + 1) = state x(k) + gain [u(k - 1) u(k) u(k + 1) u(k + 2)]
  Matrix gain;              // order x 4
  Eigen::RowVectorXd rate;  // derivative of the output from the state
  double rate_input = 0.0;  // and from the input
};

Recursion discretise(const CausalElement& e, double step_s) {
  require(e.order == 1 || e.order == 2, "order", "a causal element has order 1 or 2");
  require(e.omega > 0.0 && e.zeta > 0.0 && std::isfinite(e.omega) && std::isfinite(e.zeta), "omega",
          "frequency and damping ratio of a causal element must be positive");
  const Index n = e.order;
  // The input's cubic rides along as four more states, each the derivative of the one before.
  Matrix chain = Matrix::Zero(n + 4, n + 4);
  chain.topLeftCorner(n, n) = dynamics(e) * step_s;
  chain(n - 1, n) = e.omega * step_s;
  for (Index k = 0; k < 3; ++k) chain(n + k, n + k + 1) = 1.0;
  const Matrix whole = exponential(chain);
  // Derivatives of the cubic at 0 from its values at -1, 0, 1, 2.
  Matrix derivatives(4, 4);
  derivatives << 0.0, 1.0, 0.0, 0.0, -1.0 / 3.0, -0.5, 1.0, -1.0 / 6.0, 1.0, -2.0, 1.0, 0.0, -1.0,
      3.0, -3.0, 1.0;
  Recursion r;
  r.state = whole.topLeftCorner(n, n);
  r.gain = whole.topRightCorner(n, 4) * derivatives;
  r.rate = Eigen::RowVectorXd::Zero(n);
  if (n == 1) {
    r.rate[0] = -e.omega;
    r.rate_input = e.omega;
  } else {
    r.rate[1] = e.omega;
  }
  return r;
}

}  // namespace

Matrix element_response(const CausalElement& element, VectorRef input, double step_s) {
  const Recursion r = discretise(element, step_s);
  const Index rows = input.size();
  Matrix out(rows, 2);
  if (rows == 0) return out;
  // Beyond the ends the input goes on as a straight line.
  Vector padded(rows + 3);
  padded.segment(1, rows) = input;
  const double before = rows > 1 ? input[1] - input[0] : 0.0;
  const double after = rows > 1 ? input[rows - 1] - input[rows - 2] : 0.0;
  padded[0] = input[0] - before;
  padded[rows + 1] = input[rows - 1] + after;
  padded[rows + 2] = input[rows - 1] + 2.0 * after;
  const bool first_order = element.order == 1;
  const double a00 = r.state(0, 0);
  const double a01 = first_order ? 0.0 : r.state(0, 1);
  const double a10 = first_order ? 0.0 : r.state(1, 0);
  const double a11 = first_order ? 0.0 : r.state(1, 1);
  std::array<double, 4> g0{};
  std::array<double, 4> g1{};
  for (std::size_t k = 0; k < 4; ++k) {
    g0[k] = r.gain(0, static_cast<Index>(k));
    g1[k] = first_order ? 0.0 : r.gain(1, static_cast<Index>(k));
  }
  const double rate0 = r.rate[0];
  const double rate1 = first_order ? 0.0 : r.rate[1];
  double x0 = 0.0;
  double x1 = 0.0;
  const double* u = padded.data();
  double* value = out.data();
  double* rate = value + rows;
  for (Index i = 0; i < rows; ++i) {
    value[i] = x0;
    rate[i] = rate0 * x0 + rate1 * x1 + r.rate_input * u[i + 1];
    const double in0 = g0[0] * u[i] + g0[1] * u[i + 1] + g0[2] * u[i + 2] + g0[3] * u[i + 3];
    const double in1 = g1[0] * u[i] + g1[1] * u[i + 1] + g1[2] * u[i + 2] + g1[3] * u[i + 3];
    const double next = a00 * x0 + a01 * x1 + in0;
    x1 = a10 * x0 + a11 * x1 + in1;
    x0 = next;
  }
  return out;
}

Matrix element_free(const CausalElement& element, Index rows, double step_s, int state) {
  const Recursion r = discretise(element, step_s);
  Matrix out(rows, 2);
  Vector x = Vector::Unit(element.order, state);
  for (Index i = 0; i < rows; ++i) {
    out(i, 0) = x[0];
    out(i, 1) = r.rate * x;
    x = r.state * x;
  }
  return out;
}

double delayed_value(const Matrix& value_and_rate, double step_s, double row_minus_delay) {
  const Index rows = value_and_rate.rows();
  if (row_minus_delay < 0.0) return 0.0;
  Index k = static_cast<Index>(row_minus_delay);
  if (k >= rows - 1) k = rows - 2;
  const double f = row_minus_delay - static_cast<double>(k);
  return hermite(value_and_rate(k, 0), step_s * value_and_rate(k, 1), value_and_rate(k + 1, 0),
                 step_s * value_and_rate(k + 1, 1), f);
}

}  // namespace ulna
