#include "passivity/axis_system.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "signal/pencil.hpp"

namespace ulna {
namespace {

using Eigen::MatrixXcd;

constexpr Complex kJ(0.0, 1.0);

std::vector<double> near_axis(const AxisSystem& h, MatrixXcd hamiltonian) {
  std::vector<double> out;
  if (!hamiltonian.allFinite()) return out;
  balance(hamiltonian);
  const Eigen::ComplexEigenSolver<MatrixXcd> solver(hamiltonian, false);
  if (solver.info() != Eigen::Success) return out;
  for (const Complex s : solver.eigenvalues()) {
    // Generous: rounding moves double eigenvalues off the axis, and what is no crossing is
    // harmless.
    if (std::abs(s.real()) > 0.02 * (1.0 + std::abs(s.imag()))) continue;
    const double x = s.imag();
    const double omega = h.scale * (x + h.turn) / (1.0 - x * h.turn);
    if (std::isfinite(omega)) out.push_back(std::abs(omega));
  }
  return out;
}

bool invertible(const Eigen::PartialPivLU<MatrixXcd>& lu) {
  const auto pivots = lu.matrixLU().diagonal().cwiseAbs();
  return pivots.size() == 0 || pivots.minCoeff() > 1e-13 * pivots.maxCoeff();
}

}  // namespace

AxisSystem axis_system(const StateSpace& m, double scale_rad_s) {
  AxisSystem out;
  out.scale = scale_rad_s;
  const Index n = m.a.rows();
  if (n == 0) {
    out.a = MatrixXcd(0, 0);
    out.b = m.b.cast<Complex>();
    out.c = m.c.cast<Complex>();
    out.d = m.d.cast<Complex>();
    return out;
  }
  const MatrixXcd a = m.a.cast<Complex>();
  const MatrixXcd e = m.e.size() == 0 ? MatrixXcd(MatrixXcd::Identity(n, n)) : m.e.cast<Complex>();
  Eigen::FullPivLU<MatrixXcd> best;
  double best_condition = -1.0;
  // s E - A = [x F + (j scale turn E - A)] / (1 - x turn), F = j scale E + turn A. Of a few turns,
  // the one that makes F best conditioned.
  for (const double turn : {0.8641, -1.2913, 0.4127}) {
    const Eigen::FullPivLU<MatrixXcd> lu(kJ * out.scale * e + turn * a);
    const auto pivots = lu.matrixLU().diagonal().cwiseAbs();
    const double condition = pivots.minCoeff() / std::max(pivots.maxCoeff(), 1e-300);
    if (condition > best_condition) {
      best_condition = condition;
      best = lu;
      out.turn = turn;
    }
  }
  const MatrixXcd b = best.solve(m.b.cast<Complex>());
  const MatrixXcd back = best.solve(a - kJ * out.scale * out.turn * e);
  out.a = kJ * back;
  out.b = b;
  out.c = kJ * (m.c.cast<Complex>() * (MatrixXcd::Identity(n, n) - out.turn * back));
  out.d = m.d.cast<Complex>() - out.turn * m.c * b;
  return out;
}

std::optional<AxisSystem> inverse(const AxisSystem& h) {
  const Eigen::PartialPivLU<MatrixXcd> lu(h.d);
  if (!invertible(lu) || !(h.d.norm() > 0.0)) return std::nullopt;
  AxisSystem out = h;
  const Index p = h.d.rows();
  out.d = lu.solve(MatrixXcd::Identity(p, p));
  out.c = -lu.solve(h.c);
  out.b = h.b * out.d;
  out.a = h.a + h.b * out.c;
  return out;
}

AxisSystem plus_identity(AxisSystem h) {
  h.d.diagonal().array() += 1.0;
  return h;
}

std::optional<AxisSystem> scattering(const AxisSystem& h) {
  std::optional<AxisSystem> out = inverse(plus_identity(h));
  if (!out) return out;
  out->c *= 2.0;
  out->d *= 2.0;
  out->d.diagonal().array() -= 1.0;
  return out;
}

AxisSystem along(const AxisSystem& h, const Vector& direction) {
  AxisSystem out = h;
  const MatrixXcd u = direction.cast<Complex>();
  out.b = h.b * u;
  out.c = u.transpose() * h.c;
  out.d = u.transpose() * h.d * u;
  return out;
}

std::vector<double> hermitian_crossings(const AxisSystem& h, double level) {
  const Index n = h.a.rows();
  if (n == 0) return {};
  MatrixXcd r = h.d + h.d.adjoint();
  r.diagonal().array() -= 2.0 * level;
  const Eigen::PartialPivLU<MatrixXcd> lu(r);
  // s x = A x + B u, s z = -A* z - C* u, 0 = C x + B* z + R u.
  const MatrixXcd rc = lu.solve(h.c);
  const MatrixXcd rb = lu.solve(MatrixXcd(h.b.adjoint()));
  MatrixXcd m(2 * n, 2 * n);
  m.topLeftCorner(n, n) = h.a - h.b * rc;
  m.topRightCorner(n, n) = -h.b * rb;
  m.bottomLeftCorner(n, n) = h.c.adjoint() * rc;
  m.bottomRightCorner(n, n) = -h.a.adjoint() + h.c.adjoint() * rb;
  return near_axis(h, std::move(m));
}

std::vector<double> gain_crossings(const AxisSystem& h, double gain) {
  const Index n = h.a.rows();
  if (n == 0) return {};
  MatrixXcd r = -h.d.adjoint() * h.d;
  r.diagonal().array() += gain * gain;
  const Eigen::PartialPivLU<MatrixXcd> lu(r);
  // s x = A x + B u, y = C x + D u, s z = -A* z - C* y, gain^2 u = B* z + D* y.
  const MatrixXcd ux = lu.solve(MatrixXcd(h.d.adjoint() * h.c));
  const MatrixXcd uz = lu.solve(MatrixXcd(h.b.adjoint()));
  MatrixXcd m(2 * n, 2 * n);
  m.topLeftCorner(n, n) = h.a + h.b * ux;
  m.topRightCorner(n, n) = h.b * uz;
  m.bottomLeftCorner(n, n) = -h.c.adjoint() * (h.c + h.d * ux);
  m.bottomRightCorner(n, n) = -h.a.adjoint() - h.c.adjoint() * h.d * uz;
  return near_axis(h, std::move(m));
}

}  // namespace ulna
