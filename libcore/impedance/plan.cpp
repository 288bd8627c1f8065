#include "impedance/plan.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>

#include "base/error.hpp"
#include "base/words.hpp"
#include "ident/linear.hpp"
#include "impedance/natural.hpp"
#include "impedance/plan_noise.hpp"
#include "impedance/split.hpp"
#include "impedance/words.hpp"
#include "signal/butterworth.hpp"
#include "signal/response.hpp"

namespace ulna {
namespace {

using Complex = std::complex<double>;
using Eigen::MatrixXcd;

// Above this relative noise in the instruments' hold the first order no longer tells the error.
constexpr double kWeak = 0.3;
// Frequencies up to this multiple of the low pass: two passes of order 5 leave 1e-6 of the power.
constexpr double kBandMultiple = 2.0;
constexpr double kBias = 1.0;  // in standard errors: what a reader would see

void check(const SensorNoise& noise, const PlanOptions& options) {
  require(std::isfinite(noise.force) && noise.force >= 0.0, "force_noise",
          "the noise of the force must be 0 or more");
  require(std::isfinite(noise.position) && noise.position >= 0.0, "position_noise",
          "the noise of the position must be 0 or more");
  require(std::isfinite(options.repetitions) && options.repetitions > 0.0, "repetitions",
          "the number of repetitions must be positive");
  require(std::isfinite(options.train_s) && options.train_s >= 0.0, "train_s",
          "the time to identify from must be positive");
}

// The recording without any noise, positions from where the robot starts.
Record foreseen(const Excitation& excitation, const ArmLoop& loop, Token* token) {
  const ArmLoop::Response response = loop.respond(excitation, token);
  const Index n = loop.axes();
  Record::Parts parts;
  parts.rate_hz = excitation.rate_hz;
  parts.values.resize(excitation.rows(), 3 * n);
  parts.values.leftCols(n) = response.position.rowwise() + loop.rest_position().transpose();
  parts.values.middleCols(n, n) = response.force.rowwise() + loop.rest_force().transpose();
  parts.values.rightCols(n) = excitation.value;
  const auto name = [&](const char* before, Role role) {
    for (Index a = 0; a < n; ++a) {
      Channel channel;
      channel.name = before + std::to_string(a + 1);
      channel.unit = role == Role::kForce ? "N" : "m";
      channel.role = role;
      channel.axis = static_cast<int>(a);
      parts.channels.push_back(std::move(channel));
    }
  };
  name("position ", Role::kPosition);
  name("force ", Role::kForce);
  name("reference ", Role::kReference);
  for (const RowRange& range : excitation.segments) {
    parts.segments.push_back({range.begin, range.end, 0});
  }
  return Record::make(std::move(parts));
}

// Gain of the value smoother, on a grid of its own and straight between: it is smooth, and its
// exact evaluation costs a sum over the window.
class SmootherGain {
 public:
  SmootherGain(const PrepareReport& report, double highest_hz)
      : step_(highest_hz / static_cast<double>(kSteps)) {
    Sos sos;
    const bool lowpass = report.lowpass_order > 0;
    if (lowpass) sos = butterworth_lowpass(report.lowpass_order, report.lowpass_hz, report.rate_hz);
    const Vector freq = Vector::LinSpaced(kSteps + 1, 0.0, highest_hz);
    gain_ = smoother_response({report.window, report.order}, lowpass ? &sos : nullptr,
                              report.rate_hz, freq)
                .col(0);
  }

  double squared(double freq_hz) const {
    const double place = freq_hz / step_;
    const Index i = std::min<Index>(kSteps - 1, static_cast<Index>(place));
    const double share = place - static_cast<double>(i);
    const double gain = (1.0 - share) * gain_[i] + share * gain_[i + 1];
    return gain * gain;
  }

 private:
  static constexpr Index kSteps = 500;
  double step_;
  Vector gain_;
};

// Of the noise in [a v x 1] and in the residual e = y - Phi theta = -(d + n_F + Z_h n_x).
NoiseSpectra noise_spectra(const ArmLoop& loop, const Tremor& tremor, const SensorNoise& noise,
                           const PrepareReport& report, double step_hz, Index bins, Token* token) {
  const Index n = loop.axes();
  const Index p = 3 * n + 1;
  const SmootherGain gain(report, step_hz * static_cast<double>(bins));
  const double force = noise.force * noise.force / report.rate_hz;
  const double position = noise.position * noise.position / report.rate_hz;
  NoiseSpectra out{step_hz, {}};
  out.density.reserve(static_cast<std::size_t>(bins));
  const MatrixXcd one = MatrixXcd::Identity(n, n);
  for (Index k = 0; k < bins; ++k) {
    if (k % 256 == 0) step(token, 0.5);
    const double f = step_hz * static_cast<double>(k);
    const double human = tremor.density(f);
    const MatrixXcd z = loop.impedance(f);
    MatrixXcd moved = MatrixXcd::Zero(n, n);
    if (human > 0.0) moved = loop.compliance(f);
    const MatrixXcd xx = human * moved * moved.adjoint() + position * one;
    const MatrixXcd xe = -(human * moved + position * z.adjoint());
    const MatrixXcd ee = (human + force) * one + position * z * z.adjoint();
    MatrixXcd density = MatrixXcd::Zero(p + n, p + n);
    const Complex s(0.0, 2.0 * kPi * f);
    const Complex powers[3] = {s * s, s, 1.0};
    for (Index a = 0; a < 3; ++a) {
      for (Index b = 0; b < 3; ++b) {
        density.block(a * n, b * n, n, n) = powers[a] * std::conj(powers[b]) * xx;
      }
      density.block(a * n, p, n, n) = powers[a] * xe;
      density.block(p, a * n, n, n) = density.block(a * n, p, n, n).adjoint();
    }
    density.bottomRightCorner(n, n) = ee;
    out.density.push_back(gain.squared(f) * density);
  }
  return out;
}

struct Rows {
  std::vector<Span> spans;
  Index first = 0;  // of all spans
  Index last = 0;
  Index stride = 1;  // rows between those that stand for all
};

// Columns [first, first + width) of the regression at every stride-th row of the spans, zero
// elsewhere: the pauses keep their length, so that slow noise reaches across them.
Matrix sampled(const Design& design, const Rows& rows, Index first, Index width) {
  Matrix out = Matrix::Zero((rows.last - rows.first) / rows.stride + 1, width);
  Matrix row(1, design.columns());
  for (const Span& span : rows.spans) {
    const Index offset = (span.begin - rows.first + rows.stride - 1) / rows.stride;
    for (Index i = offset; rows.first + i * rows.stride < span.end; ++i) {
      design.fill(span.trial, rows.first + i * rows.stride, 1, row);
      out.row(i) = row.middleCols(first, width);
    }
  }
  return out;
}

Matrix bread_of(const Matrix& information, const Matrix& transform) {
  return transform * information.ldlt().solve(transform.transpose());
}

// Least squares on data with this noise: bias of vec(theta) and its covariance. With the parameters
// moved by the bias D, the score of parameter (i, a) at a row varies by
//     phi_a e_i - phi~_a g_i + phi~_a e_i,   e = residual - phi~' D,   g = phi' D,
// phi known and phi~ noise. The first two are linear in the noise. For the product of two noises
// Isserlis' theorem gives the covariance, and Parseval's turns its sum over lags into one over
// frequencies.
struct LeastSquares {
  Vector bias;
  Matrix covariance;
};

Matrix linear_part(const Matrix& regressors, const Matrix& shift,
                   const std::vector<MatrixXcd>& joint, double rate_hz) {
  const Index p = shift.rows();
  const Index n = shift.cols();
  const Transforms known(regressors, rate_hz, static_cast<Index>(joint.size()));
  Matrix out = Matrix::Zero(p * n, p * n);
  for (std::size_t k = 0; k < joint.size(); ++k) {
    const MatrixXcd& s = joint[k];
    const auto row = static_cast<Index>(k);
    const Eigen::VectorXcd f = known.values().row(row).adjoint();  // conj
    const Eigen::VectorXcd g = shift.transpose() * f;
    const auto aa = s.topLeftCorner(p, p);
    const auto ae = s.topRightCorner(p, n);
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j) {
        out.block(i * p, j * p, p, p) +=
            known.weight(row) *
            (s(p + i, p + j) * f * f.adjoint() - std::conj(g[j]) * f * ae.col(i).adjoint() -
             g[i] * ae.col(j) * f.adjoint() + g[i] * std::conj(g[j]) * aa)
                .real();
      }
    }
  }
  return out;
}

Matrix product_part(const std::vector<MatrixXcd>& joint, double weight, Index p, Index n) {
  Matrix out = Matrix::Zero(p * n, p * n);
  for (std::size_t k = 0; k < joint.size(); ++k) {
    const MatrixXcd& s = joint[k];
    const double both = k == 0 ? weight : 2.0 * weight;
    const auto aa = s.topLeftCorner(p, p);
    const auto ae = s.topRightCorner(p, n);
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j) {
        out.block(i * p, j * p, p, p) +=
            both * (aa * std::conj(s(p + i, p + j)) + ae.col(j) * ae.col(i).transpose()).real();
      }
    }
  }
  return out;
}

LeastSquares least_squares(const Matrix& gram, const Matrix& regressors, const Matrix& transform,
                           const NoiseSpectra& spectra, double rate_hz, double rows, double stride,
                           Index n) {
  const Index p = 3 * n + 1;
  const Index each = p * n;
  const Matrix moments = rows * integral(spectra);
  const Matrix noisy = gram + moments.topLeftCorner(p, p);
  Matrix information = Matrix::Zero(each, each);
  for (Index i = 0; i < n; ++i) information.block(i * p, i * p, p, p) = noisy;
  const Matrix bread = bread_of(transform.transpose() * information * transform, transform);
  LeastSquares out;
  out.bias = bread * Matrix(moments.topRightCorner(p, n)).reshaped();

  const Matrix shift = out.bias.reshaped(p, n);
  Matrix turn = Matrix::Identity(p + n, p + n);
  turn.bottomLeftCorner(n, p) = -shift.transpose();
  std::vector<MatrixXcd> joint;
  joint.reserve(spectra.density.size());
  for (const MatrixXcd& s : spectra.density) joint.push_back(turn * s * turn.transpose());
  Matrix meat = stride * stride * linear_part(regressors, shift, joint, rate_hz) +
                product_part(joint, rows * rate_hz * stride * spectra.step_hz, p, n);
  meat = 0.5 * (meat + meat.transpose()).eval();
  out.covariance = bread * meat * bread.transpose();
  return out;
}

// Relative size of what noise adds to the product of instruments and regressors.
double weakness_of(const Matrix& weighted, const Matrix& gram, const NoiseSpectra& spectra,
                   double rate_hz, double stride) {
  const Index p = gram.rows();
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(0.5 * (gram + gram.transpose()));
  const Vector values = eigen.eigenvalues();
  if (!(values[0] > 0.0)) return std::numeric_limits<double>::infinity();
  const Matrix root = eigen.eigenvectors() * values.cwiseSqrt().cwiseInverse().asDiagonal() *
                      eigen.eigenvectors().transpose();
  const Transforms unit(weighted * root, rate_hz, static_cast<Index>(spectra.density.size()));
  Matrix variance = Matrix::Zero(p, p);
  for (Index k = 0; k < unit.values().rows(); ++k) {
    const auto& density = spectra.density[static_cast<std::size_t>(k)];
    const Vector noise = (root * density.topLeftCorner(p, p) * root).diagonal().real();
    const Vector hold = unit.values().row(k).cwiseAbs2().transpose();
    variance += stride * stride * unit.weight(k) * hold * noise.transpose();
  }
  return std::sqrt(variance.colwise().sum().maxCoeff());
}

Vector motion_by_human(const Matrix& regressors, const NoiseSpectra& spectra, double rows,
                       double stride, Index n) {
  const Matrix noise = integral(spectra);
  Vector rho(n);
  for (Index a = 0; a < n; ++a) {
    const double caused = stride * regressors.col(2 * n + a).squaredNorm() / rows;
    const double human = noise(2 * n + a, 2 * n + a);
    rho[a] = human + caused > 0.0 ? human / (human + caused) : 0.0;
  }
  return rho;
}

void require_determined(const Fit& fit, Index n, double limit) {
  if (fit.condition <= limit && fit.theta.allFinite()) return;
  static const char* const kNames[] = {"x", "y", "z", "u", "v", "w"};
  const std::vector<std::string> axes =
      n == 1 ? std::vector<std::string>{"x"} : std::vector<std::string>(kNames, kNames + n);
  throw Error(
      Fault::kAnalysis, "design",
      sentence(3, "the design does not determine the parameters: ", unidentifiable(fit, axes),
               "; its condition number is ", fit.condition, " (limit ", limit,
               "): perturb every axis, each in its own way and with several frequencies"),
      sentence(6, "condition ", fit.condition));
}

}  // namespace

Vector Plan::standard_error() const { return covariance.diagonal().cwiseMax(0.0).cwiseSqrt(); }

Plan plan_experiment(const Excitation& excitation, const ArmModel& arm, const RobotModel& robot,
                     const Tremor& tremor, const SensorNoise& noise, const PlanOptions& options,
                     Token* token) {
  check(noise, options);
  check_tremor(tremor);
  const ArmLoop loop(arm, robot, excitation.drive);
  const Index n = loop.axes();
  const Index p = 3 * n + 1;
  const Record record = foreseen(excitation, loop, token);
  const Prepared prepared =
      prepare(record, find_roles(record, "", "", ""), options.prepare, 1, token);
  const double rate = record.rate_hz();
  const Split split = split_rows(record, prepared, options.train_s);
  const bool refitted =
      options.refit == Refit::kYes || (options.refit == Refit::kAuto && split.segmented);
  Rows rows;
  rows.spans = refitted ? split.all : split.train;
  const Index count = row_count(rows.spans);
  if (count < 10 * p) {
    throw Error(Fault::kData, "design",
                "the design leaves only " + std::to_string(count) + " samples to identify " +
                    std::to_string(p * n) + " parameters; at least " + std::to_string(10 * p) +
                    " are needed");
  }
  const Design design(prepared, 0.0, rows.spans);
  const Factor factor = factorise(design, rows.spans, token);
  const bool instrumental = options.estimator != EstimatorChoice::kLeastSquares;
  const Matrix transform = structure_map(options.structure, n);
  const Fit fit =
      solve(factor, transform, instrumental ? Estimator::kInstrumental : Estimator::kLeastSquares);
  require_determined(fit, n, options.condition_limit);

  // Signals below the low pass need no more than ten samples for each of its periods.
  const double band = prepared.report.lowpass_hz > 0.0 ? prepared.report.lowpass_hz : 0.2 * rate;
  rows.stride = std::max<Index>(1, static_cast<Index>(rate / (10.0 * band)));
  rows.first = rows.spans.front().begin;
  rows.last = rows.spans.back().end - 1;
  const double stride = static_cast<double>(rows.stride);
  const double slow_rate = rate / stride;
  const Index length = Transforms::length_for((rows.last - rows.first) / rows.stride + 1);
  const double step_hz = slow_rate / static_cast<double>(length);
  const Index bins =
      std::min<Index>(length / 2, static_cast<Index>(std::ceil(kBandMultiple * band / step_hz)));
  const NoiseSpectra spectra =
      noise_spectra(loop, tremor, noise, prepared.report, step_hz, bins, token);
  const auto residual = [&](Index k) -> MatrixXcd {
    return spectra.density[static_cast<std::size_t>(k)].bottomRightCorner(n, n);
  };

  const Matrix regressors = sampled(design, rows, design.instruments(), p);
  const Matrix gram = stride * regressors.transpose() * regressors;
  const double total = static_cast<double>(count);
  const LeastSquares ls =
      least_squares(gram, regressors, transform, spectra, slow_rate, total, stride, n);

  Plan plan;
  plan.n = n;
  plan.estimator = fit.estimator;
  plan.condition = fit.condition;
  plan.repetitions = options.repetitions;
  plan.seconds = options.repetitions * excitation.duration_s();
  plan.used_s = options.repetitions * total / rate;
  plan.report = prepared.report;
  plan.rho = motion_by_human(regressors, spectra, total, stride, n);

  Matrix theta(p, n);
  theta.topRows(n) = arm.m.transpose();
  theta.middleRows(n, n) = arm.b.transpose();
  theta.middleRows(2 * n, n) = arm.k.transpose();
  theta.row(3 * n) = (arm.k * (design.position_mean() - arm.x0)).transpose();
  const Matrix jacobian = natural_jacobian(theta);
  plan.truth.resize(natural_size(n));
  plan.truth << natural_of(theta, design.position_mean()).head(3 * n * n), arm.x0;

  Matrix covariance = ls.covariance;
  if (instrumental) {
    const Matrix weighted = sampled(design, rows, 0, design.instruments()) * fit.weights;
    const Transforms transforms(weighted, slow_rate, bins);
    const Matrix meat = stride * stride * transforms.covariance(residual, n);
    const Matrix bread = bread_of(fit.information, transform);
    covariance = bread * meat * bread.transpose();
    plan.weakness = weakness_of(weighted, stride * weighted.transpose() * regressors, spectra,
                                slow_rate, stride) /
                    std::sqrt(options.repetitions);
  }
  const auto natural = [&](const Matrix& c) -> Matrix {
    const Matrix out = jacobian * c * jacobian.transpose() / options.repetitions;
    return 0.5 * (out + out.transpose());
  };
  plan.covariance = natural(covariance);
  plan.least_squares_error = natural(ls.covariance).diagonal().cwiseMax(0.0).cwiseSqrt();
  // Exact for M, B and K; x0 moves with them, not in proportion.
  plan.least_squares_bias =
      natural_of(theta + ls.bias.reshaped(p, n), design.position_mean()) - plan.truth;
  plan.bias = instrumental ? Vector::Zero(plan.truth.size()) : plan.least_squares_bias;

  if (plan.weakness > kWeak) {
    plan.warnings.push_back(sentence(
        2,
        "The reference moves the arm too little against the tremor (relative noise of the "
        "instruments ",
        plan.weakness,
        "): the errors will be larger than predicted; perturb more, longer or with a stiffer "
        "robot."));
  }
  if (!instrumental) {
    const Vector error = plan.standard_error();
    Index worst = 0;
    const double largest =
        (plan.bias.head(3 * n * n).array().abs() / error.head(3 * n * n).array().max(1e-300))
            .maxCoeff(&worst);
    if (largest > kBias) {
      plan.warnings.push_back(sentence(
          2, "Least squares will be biased, by up to ", largest,
          " standard errors, since the human causes part of the motion: record the reference and "
          "use instrumental variables."));
    }
  }
  return plan;
}

double seconds_for(const Plan& plan, Index parameter, double error) {
  require(parameter >= 0 && parameter < plan.truth.size(), "parameter",
          "the parameter must be from 0 to " + std::to_string(plan.truth.size() - 1));
  require(std::isfinite(error) && error > 0.0, "error",
          "the wanted standard error must be a positive number");
  const double variance = plan.covariance(parameter, parameter);
  return plan.seconds * variance / (error * error);
}

}  // namespace ulna
