#include "impedance/arm_loop.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <complex>
#include <string>
#include <unsupported/Eigen/MatrixFunctions>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

using Complex = std::complex<double>;
using Eigen::MatrixXcd;

// Frequencies of the integral over the tremor's band: fine enough for a loop that is hardly damped.
constexpr Index kSpreadSteps = 4000;
// A real part above this share of the fastest pole is growth, not rounding.
constexpr double kGrowth = 1e-9;

void check_matrix(const Matrix& matrix, Index n, const char* argument, const char* what) {
  require(matrix.rows() == n && matrix.cols() == n, argument,
          std::string(what) + " must be " + std::to_string(n) + " x " + std::to_string(n));
  require(matrix.allFinite(), argument, std::string(what) + " must hold finite numbers");
}

}  // namespace

double Tremor::density(double freq_hz) const noexcept {
  const double f = std::abs(freq_hz);
  if (sigma == 0.0 || f < low_hz || f > high_hz) return 0.0;
  return sigma * sigma / (2.0 * (high_hz - low_hz));
}

void check_tremor(const Tremor& tremor) {
  require(std::isfinite(tremor.sigma) && tremor.sigma >= 0.0, "tremor",
          "the tremor's standard deviation must be 0 or more");
  require(std::isfinite(tremor.low_hz) && tremor.low_hz >= 0.0 && std::isfinite(tremor.high_hz) &&
              tremor.high_hz > tremor.low_hz,
          "tremor_band_hz", "the tremor's band must be two frequencies, the lower one first");
}

ArmLoop::ArmLoop(ArmModel arm, RobotModel robot, Drive drive)
    : arm_(std::move(arm)), robot_(std::move(robot)), drive_(drive) {
  const Index n = arm_.m.rows();
  check_axes(n);
  check_matrix(arm_.m, n, "M", "the arm's inertia M");
  check_matrix(arm_.b, n, "B", "the arm's damping B");
  check_matrix(arm_.k, n, "K", "the arm's stiffness K");
  require(arm_.x0.size() == n && arm_.x0.allFinite(), "x0",
          "the equilibrium x0 must hold a finite number for each axis");
  check_matrix(robot_.stiffness, n, "stiffness", "the robot's stiffness");
  check_matrix(robot_.damping, n, "damping", "the robot's damping");
  check_matrix(robot_.mass, n, "mass", "the robot's mass");
  mass_ = arm_.m + robot_.mass;
  damping_ = arm_.b + robot_.damping;
  stiffness_ = arm_.k + robot_.stiffness;
  const Eigen::SelfAdjointEigenSolver<Matrix> inertia(0.5 * (mass_ + mass_.transpose()));
  require(inertia.eigenvalues()[0] > 1e-12 * inertia.eigenvalues()[n - 1], "M",
          "the inertia of arm and robot together must be positive in every direction: without it "
          "nothing says how fast they move");

  Matrix a = Matrix::Zero(2 * n, 2 * n);
  a.topRightCorner(n, n).setIdentity();
  const Eigen::PartialPivLU<Matrix> lu(mass_);
  a.bottomLeftCorner(n, n) = -lu.solve(stiffness_);
  a.bottomRightCorner(n, n) = -lu.solve(damping_);
  const Eigen::VectorXcd poles = a.eigenvalues();
  const double growth = poles.real().maxCoeff();
  if (growth > kGrowth * poles.cwiseAbs().maxCoeff()) {
    throw Error(
        Fault::kAnalysis, "robot",
        sentence(3,
                 "arm and robot together are unstable: a motion grows by a factor of e "
                 "every ",
                 1.0 / growth, " s; give the robot stiffness and damping that hold this arm"));
  }
  // Least squares picks the equilibrium nearest to 0 where the loop leaves a direction free.
  const Vector pull = arm_.k * arm_.x0;
  rest_position_ = stiffness_.completeOrthogonalDecomposition().solve(pull);
  rest_force_ = pull - arm_.k * rest_position_;
}

ArmLoop::Response ArmLoop::respond(const Excitation& excitation, Token* token) const {
  const Index n = axes();
  const Index rows = excitation.rows();
  require(excitation.axes() == n, "design",
          "the design has " + std::to_string(excitation.axes()) + " axes and the arm " +
              std::to_string(n));
  require(excitation.drive == drive_, "robot",
          drive_ == Drive::kPosition
              ? "the design is a force and the robot is position-controlled"
              : "the design is a position and the robot is force-controlled");
  Matrix input = excitation.value;
  if (drive_ == Drive::kPosition) {
    input = excitation.value * robot_.stiffness.transpose() +
            excitation.rate * robot_.damping.transpose();
  }

  // First-order hold: exp of [A B 0; 0 0 I; 0 0 0] over one step holds the transition and both
  // weights of the input.
  const double h = 1.0 / excitation.rate_hz;
  const Eigen::PartialPivLU<Matrix> lu(mass_);
  const Matrix inverse = lu.inverse();
  Matrix big = Matrix::Zero(4 * n, 4 * n);
  big.block(0, n, n, n) = Matrix::Identity(n, n) * h;
  big.block(n, 0, n, n) = -inverse * stiffness_ * h;
  big.block(n, n, n, n) = -inverse * damping_ * h;
  big.block(n, 2 * n, n, n) = inverse * h;
  big.block(2 * n, 3 * n, n, n) = Matrix::Identity(n, n);
  const Matrix e = big.exp();
  const Matrix transition = e.topLeftCorner(2 * n, 2 * n);
  const Matrix next = e.block(0, 3 * n, 2 * n, n);
  const Matrix now = e.block(0, 2 * n, 2 * n, n) - next;

  Response out{Matrix(rows, n), Matrix(rows, n), Matrix(rows, n), Matrix(rows, n)};
  Matrix states(2 * n, rows);
  states.col(0).setZero();
  const Matrix inputs = input.transpose();
  for (Index i = 0; i + 1 < rows; ++i) {
    if (i % 65536 == 0) step(token, static_cast<double>(i) / static_cast<double>(rows));
    states.col(i + 1).noalias() = transition * states.col(i);
    states.col(i + 1).noalias() += now * inputs.col(i);
    states.col(i + 1).noalias() += next * inputs.col(i + 1);
  }
  out.position = states.topRows(n).transpose();
  out.velocity = states.bottomRows(n).transpose();
  out.acceleration =
      (input - out.velocity * damping_.transpose() - out.position * stiffness_.transpose()) *
      inverse.transpose();
  out.force = -(out.acceleration * arm_.m.transpose() + out.velocity * arm_.b.transpose() +
                out.position * arm_.k.transpose());
  return out;
}

MatrixXcd ArmLoop::impedance(double freq_hz) const {
  const Complex s(0.0, 2.0 * kPi * freq_hz);
  return s * s * arm_.m.cast<Complex>() + s * arm_.b.cast<Complex>() + arm_.k.cast<Complex>();
}

MatrixXcd ArmLoop::compliance(double freq_hz) const {
  const Complex s(0.0, 2.0 * kPi * freq_hz);
  const MatrixXcd z =
      s * s * mass_.cast<Complex>() + s * damping_.cast<Complex>() + stiffness_.cast<Complex>();
  return z.partialPivLu().inverse();
}

ArmLoop::Spread ArmLoop::spread(const Tremor& tremor) const {
  check_tremor(tremor);
  const Index n = axes();
  Spread out{Matrix::Zero(n, n), Matrix::Zero(n, n), Matrix::Zero(n, n)};
  if (tremor.sigma == 0.0) return out;
  // Midpoints: 0 Hz itself, where a loop without stiffness has no end, is not met.
  const double width = (tremor.high_hz - tremor.low_hz) / static_cast<double>(kSpreadSteps);
  const double weight = tremor.sigma * tremor.sigma / static_cast<double>(kSpreadSteps);
  for (Index i = 0; i < kSpreadSteps; ++i) {
    const double f = tremor.low_hz + (static_cast<double>(i) + 0.5) * width;
    const MatrixXcd g = compliance(f);
    const MatrixXcd force = MatrixXcd::Identity(n, n) - impedance(f) * g;
    const double w = 2.0 * kPi * f;
    const Matrix moved = (g * g.adjoint()).real();
    out.position += weight * moved;
    out.velocity += weight * w * w * moved;
    out.force += weight * (force * force.adjoint()).real();
  }
  return out;
}

}  // namespace ulna
