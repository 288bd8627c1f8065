#include "ident/robot_parameters.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/random.hpp"
#include "base/words.hpp"
#include "ident/wide.hpp"
#include "record/append.hpp"
#include "signal/butterworth.hpp"
#include "signal/zero_phase.hpp"
#include "stats/distributions.hpp"

namespace ulna {

namespace {

constexpr int kPoses = 24;     // of either joint, for feasibility
constexpr Index kDraws = 400;  // for its probability
constexpr double kBiasLevel = 0.01;
constexpr double kPoorVaf = 80.0;
constexpr Index kMostRows = 200000;  // thinned rows kept: a bound on memory

// Rows of both joints, thinned after the narrow filter: joint 1 above joint 2 for every instant.
struct Rows {
  Matrix phi;                 // 2 T x p
  Matrix z;                   // 2 T x p, or empty
  Vector tau;                 // 2 T
  std::vector<Index> starts;  // first instant of every run (trial)
  Index instants() const { return tau.size() / 2; }
};

Matrix columns_of(const PlanarRobot& robot, const RobotFitOptions& options, const Vector2& q,
                  const Vector2& rate, const Vector2& acceleration) {
  const Matrix y = robot.regressor(q, rate, acceleration);
  if (!options.dry_friction) return y;
  Matrix out = Matrix::Zero(2, y.cols() + 2);
  out.leftCols(y.cols()) = y;
  for (Index j = 0; j < 2; ++j) {
    out(j, y.cols() + j) = std::tanh(4.0 * rate[j] / options.dry_threshold);
  }
  return out;
}

void append(Rows& to, const Matrix& table, Index p, bool with_z, Index stride, Index begin,
            Index end) {
  const Index count = (end - begin + stride - 1) / stride;
  if (count <= 0) return;
  const Index at = to.tau.size();
  to.starts.push_back(at / 2);
  to.phi.conservativeResize(at + 2 * count, p);
  if (with_z) to.z.conservativeResize(at + 2 * count, p);
  to.tau.conservativeResize(at + 2 * count);
  for (Index i = 0; i < count; ++i) {
    const Index row = begin + i * stride;
    for (Index j = 0; j < 2; ++j) {
      to.phi.row(at + 2 * i + j) = table.row(row).segment(j * p, p);
      to.tau[at + 2 * i + j] = table(row, 2 * p + j);
      if (with_z) to.z.row(at + 2 * i + j) = table.row(row).segment(2 * p + 2 + j * p, p);
    }
  }
}

// Scores of an estimate, one row an instant: (instrument or regressor)' residual over both joints.
Matrix scores(const Rows& rows, const Matrix& weight, const Vector& theta) {
  const Vector residual = rows.tau - rows.phi * theta;
  Matrix out(rows.instants(), weight.cols());
  for (Index i = 0; i < out.rows(); ++i) {
    out.row(i) = residual[2 * i] * weight.row(2 * i) + residual[2 * i + 1] * weight.row(2 * i + 1);
  }
  return out;
}

// Newey-West with Bartlett weights; correlation never reaches across trials.
Matrix long_run(const Matrix& s, const std::vector<Index>& starts, Index lag) {
  Matrix sum = s.transpose() * s;
  for (std::size_t r = 0; r < starts.size(); ++r) {
    const Index end = r + 1 < starts.size() ? starts[r + 1] : s.rows();
    const auto run = s.middleRows(starts[r], end - starts[r]);
    for (Index l = 1; l <= std::min(lag, run.rows() - 1); ++l) {
      const double weight = 1.0 - static_cast<double>(l) / static_cast<double>(lag + 1);
      const Matrix cross = run.topRows(run.rows() - l).transpose() * run.bottomRows(run.rows() - l);
      sum += weight * (cross + cross.transpose());
    }
  }
  return sum;
}

double condition_of(const Matrix& a, Vector* weakest) {
  Vector norms = a.colwise().norm().transpose();
  if (!(norms.minCoeff() > 0.0)) {
    if (weakest != nullptr) {
      Index at = 0;
      norms.minCoeff(&at);
      *weakest = Vector::Unit(a.cols(), at);
    }
    return std::numeric_limits<double>::infinity();
  }
  const Matrix unit = a * norms.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(unit.transpose() * unit);
  if (weakest != nullptr) *weakest = eigen.eigenvectors().col(0);
  const double least = eigen.eigenvalues()[0];
  return least > 1e-15 * eigen.eigenvalues()[a.cols() - 1]
             ? std::sqrt(eigen.eigenvalues()[a.cols() - 1] / least)
             : std::numeric_limits<double>::infinity();
}

std::string combination(const Vector& direction, const std::vector<std::string>& names) {
  std::vector<std::string> parts;
  const double largest = direction.cwiseAbs().maxCoeff();
  for (Index i = 0; i < direction.size(); ++i) {
    if (std::abs(direction[i]) > 0.3 * largest) parts.push_back(names[static_cast<std::size_t>(i)]);
  }
  return parts.size() == 1 ? "the torque of " + parts[0] : "the torques of " + join(parts);
}

Vector vaf_of(const Rows& rows, const Vector& theta) {
  Vector out = Vector::Constant(2, kNaN);
  if (rows.instants() < 20) return out;
  const Vector residual = rows.tau - rows.phi * theta;
  for (Index j = 0; j < 2; ++j) {
    const auto every = Eigen::seqN(j, rows.instants(), 2);
    const Vector e = residual(every);
    const Vector t = rows.tau(every);
    const double power = (t.array() - t.mean()).square().sum();
    if (power > 0.0) out[j] = 100.0 * (1.0 - (e.array() - e.mean()).square().sum() / power);
  }
  return out;
}

}  // namespace

Feasibility feasibility(const PlanarRobot& robot, const Vector& parameters) {
  Feasibility out{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  const Index p = robot.parameters().size();
  const Vector alpha = parameters.head(p);
  // At this speed Coriolis torques, of second order in it, are rounding beside friction.
  constexpr double kSlow = 1e-9;
  for (int a = 0; a < kPoses; ++a) {
    for (int b = 0; b < kPoses; ++b) {
      const Vector2 q(2.0 * kPi * a / kPoses, 2.0 * kPi * b / kPoses);
      Matrix2 inertia;
      Matrix2 friction;
      for (Index j = 0; j < 2; ++j) {
        const Vector2 unit = Vector2::Unit(j);
        inertia.col(j) = robot.regressor(q, Vector2::Zero(), unit) * alpha;
        friction.col(j) = robot.regressor(q, kSlow * unit, Vector2::Zero()) * alpha / kSlow;
      }
      const auto least = [](const Matrix2& m) {
        return Eigen::SelfAdjointEigenSolver<Matrix2>(0.5 * (m + m.transpose())).eigenvalues()[0];
      };
      out.least_inertia = std::min(out.least_inertia, least(inertia));
      out.least_friction = std::min(out.least_friction, least(friction));
    }
  }
  for (Index i = p; i < parameters.size(); ++i) {
    out.least_friction = std::min(out.least_friction, parameters[i]);
  }
  return out;
}

RobotFit identify_robot(const Record& record, const PlanarRobot& robot,
                        const RobotFitOptions& options, Token* token) {
  require(options.train_s >= 0.0 && std::isfinite(options.train_s), "train_s",
          "the time to identify from must be positive");
  require(options.lag_s > 0.0 && std::isfinite(options.lag_s), "lag_s",
          "the lag of the standard errors must be a positive number");
  require(options.condition_limit > 1.0, "condition_limit",
          "the limit of the condition number must be above 1");
  require(options.dry_threshold > 0.0 && std::isfinite(options.dry_threshold),
          "dry_threshold_rad_s",
          "the speed within which dry friction turns its sign must be above zero");
  const auto two = [&](const std::string& word, const char* argument, const std::string& unit,
                       const std::string& advice) {
    const std::vector<Index> found = channels_of(record, word, argument);
    require(found.size() == 2, argument,
            std::string(argument) + " stands for " + std::to_string(found.size()) +
                " channels; the robot has two joints");
    require_unit(record, found, unit, advice);
    return found;
  };
  const std::vector<Index> angle = two(first_word(record, options.angle, {"theta", "q"}), "angle",
                                       "rad", "name the joint angles");
  const std::vector<Index> torque =
      two(first_word(record, options.torque, {"tau"}), "torque", "Nm", "name the motor torques");
  std::vector<Index> reference;
  if (!options.reference.empty()) {
    reference = two(options.reference, "reference", "rad", "name the commanded joint angles");
  }
  std::vector<Index> force;
  if (!options.force.empty()) force = two(options.force, "force", "N", "name the external force");

  RobotFit out;
  const bool with_z = !reference.empty();
  out.lowpass_hz = options.prepare.lowpass_hz > 0.0
                       ? options.prepare.lowpass_hz
                       : chosen_lowpass(record, with_z ? reference : angle, options.prepare);
  PrepareOptions wide = options.prepare;
  wide.window = 0;
  wide.lowpass_hz = std::min(4.0 * out.lowpass_hz, 0.2 * record.rate_hz());
  out.wide_hz = wide.lowpass_hz;
  Prepared prepared = prepare(record, {angle, torque, reference}, wide, options.threads, token);
  drop_transients(prepared, record);
  std::vector<Matrix> forces;
  if (!force.empty()) {
    Prepared other = prepare(record, {angle, force, {}}, wide, options.threads, token);
    drop_transients(other, record);
    for (const PreparedTrial& trial : other.trials) forces.push_back(trial.force());
  }

  const Index alphas = robot.parameters().size();
  const Index p = alphas + (options.dry_friction ? 2 : 0);
  for (Index i = 0; i < alphas; ++i) out.names.push_back("alpha_" + std::to_string(i + 1));
  for (Index j = 0; j + alphas < p; ++j) out.names.push_back("dry_" + std::to_string(j + 1));

  const double rate = record.rate_hz();
  const int order = options.prepare.lowpass_order == 0 ? 5 : options.prepare.lowpass_order;
  const Sos narrow = butterworth_lowpass(order, out.lowpass_hz, rate);
  Index all_rows = 0;
  for (const PreparedTrial& trial : prepared.trials) all_rows += trial.rows();
  // Products of two signals reach twice the band: twenty instants a period of it lose nothing.
  const Index stride = std::max<Index>(
      {1, static_cast<Index>(rate / (20.0 * out.lowpass_hz)), all_rows / kMostRows});
  Rows train;
  Rows held_out;
  for (std::size_t t = 0; t < prepared.trials.size(); ++t) {
    const PreparedTrial& trial = prepared.trials[t];
    Matrix table(trial.rows(), 2 * p + 2 + (with_z ? 2 * p : 0));
    for (Index row = 0; row < trial.rows(); ++row) {
      if (row % 16384 == 0) step(token, 0.5 * static_cast<double>(t));
      const Vector2 q = trial.position().row(row).transpose();
      const Matrix y = columns_of(robot, options, q, trial.velocity().row(row).transpose(),
                                  trial.acceleration().row(row).transpose());
      Vector2 tau = trial.force().row(row).transpose();
      if (!forces.empty()) {
        tau += robot.at(q, Vector2::Zero()).jacobian.transpose() *
               Vector2(forces[t].row(row).transpose());
      }
      for (Index j = 0; j < 2; ++j) {
        table.row(row).segment(j * p, p) = y.row(j);
        table(row, 2 * p + j) = tau[j];
      }
      if (!with_z) continue;
      const Matrix z = columns_of(robot, options, trial.reference().row(row).transpose(),
                                  trial.reference_rate().row(row).transpose(),
                                  trial.reference_acceleration().row(row).transpose());
      for (Index j = 0; j < 2; ++j) table.row(row).segment(2 * p + 2 + j * p, p) = z.row(j);
    }
    filter_zero_phase(narrow, options.prepare.zero_phase, table);
    // As the thesis: the first 40 s identify, at most 80 % of a trial.
    const double wanted = options.train_s > 0.0 ? options.train_s * rate : 40.0 * rate;
    const Index split = std::min(static_cast<Index>(wanted),
                                 static_cast<Index>(0.8 * static_cast<double>(trial.rows())));
    append(train, table, p, with_z, stride, 0, split);
    append(held_out, table, p, with_z, stride, split, trial.rows());
    out.train_rows += split;
    out.held_out_rows += trial.rows() - split;
    out.train_s = static_cast<double>(split) / rate;
  }
  if (train.instants() < 10 * p) {
    throw Error(Fault::kData, "time",
                sentence(6, "only ", train.instants(), " independent samples are left to identify ",
                         p, " parameters: record longer"));
  }

  Vector weakest;
  const double condition = condition_of(train.phi, &weakest);
  if (!(condition <= options.condition_limit)) {
    throw Error(
        Fault::kAnalysis, "angle",
        sentence(3, "the motion does not tell ", combination(weakest, out.names),
                 " apart; the condition number is ", condition, " (limit ", options.condition_limit,
                 "): move both joints at the same time, over a wide range and at several "
                 "frequencies"),
        sentence(6, "condition ", condition));
  }

  // Least squares and, from the commanded motion, instrumental variables.
  const Eigen::HouseholderQR<Matrix> qr(train.phi);
  const Vector least_squares = qr.solve(train.tau);
  const Matrix normal = (train.phi.transpose() * train.phi).inverse();
  Vector instrumental;
  Matrix bridge;
  double z_condition = 0.0;
  if (with_z) {
    const Matrix moment = train.z.transpose() * train.phi;
    const Eigen::FullPivLU<Matrix> lu(moment);
    // Of the part of the regressor that the command explains.
    const Matrix basis =
        Eigen::HouseholderQR<Matrix>(train.z).householderQ() * Matrix::Identity(train.z.rows(), p);
    z_condition = condition_of(basis.transpose() * train.phi, &weakest);
    if (!(z_condition <= options.condition_limit) || !lu.isInvertible()) {
      throw Error(Fault::kAnalysis, "reference",
                  sentence(3, "with the reference as instrument, the motion does not tell ",
                           combination(weakest, out.names), " apart; the condition number is ",
                           z_condition, " (limit ", options.condition_limit,
                           "): check that the reference is the commanded motion of both joints"));
    }
    bridge = lu.inverse();
    instrumental = bridge * (train.z.transpose() * train.tau);
  }
  const Index lag = static_cast<Index>(options.lag_s * rate / static_cast<double>(stride));
  const double independent = 2.0 * out.lowpass_hz * static_cast<double>(out.train_rows) / rate;
  const double taken = 0.5 * static_cast<double>(p);
  const double shrinkage = independent > 2.0 * taken ? independent / (independent - taken) : 2.0;
  Matrix joint = scores(train, train.phi, least_squares);
  if (with_z) {
    Matrix both(joint.rows(), 2 * p);
    both << scores(train, train.z, instrumental), joint;
    joint = std::move(both);
  }
  const Matrix meat = shrinkage * long_run(joint, train.starts, lag);
  const bool report_iv = with_z && !options.least_squares;
  out.difference_p = kNaN;
  if (!with_z) {
    out.value = least_squares;
    out.covariance = normal * meat * normal;
    out.condition = condition;
  } else {
    Matrix bread = Matrix::Zero(2 * p, 2 * p);
    bread.topLeftCorner(p, p) = bridge;
    bread.bottomRightCorner(p, p) = normal;
    const Matrix covariance = bread * meat * bread.transpose();
    const Matrix iv_covariance = covariance.topLeftCorner(p, p);
    const Matrix ls_covariance = covariance.bottomRightCorner(p, p);
    out.value = report_iv ? instrumental : least_squares;
    out.covariance = report_iv ? iv_covariance : ls_covariance;
    out.other = report_iv ? least_squares : instrumental;
    out.other_covariance = report_iv ? ls_covariance : iv_covariance;
    out.condition = report_iv ? z_condition : condition;
    // Differences below a millionth of a parameter are rounding.
    const Vector difference = least_squares - instrumental;
    Matrix spread = iv_covariance + ls_covariance - covariance.topRightCorner(p, p) -
                    covariance.bottomLeftCorner(p, p);
    spread.diagonal() += 1e-12 * instrumental.cwiseAbs2();
    const Vector scale = spread.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<Matrix> eigen(scale.asDiagonal() * spread *
                                                      scale.asDiagonal());
    const Vector along = eigen.eigenvectors().transpose() * scale.cwiseProduct(difference);
    double statistic = 0.0;
    double degrees = 0.0;
    for (Index i = 0; i < p; ++i) {
      if (eigen.eigenvalues()[i] < 1e-9 * eigen.eigenvalues()[p - 1]) continue;
      statistic += along[i] * along[i] / eigen.eigenvalues()[i];
      degrees += 1.0;
    }
    out.difference_p = chi_square_tail(statistic, degrees);
  }
  out.covariance = 0.5 * (out.covariance + out.covariance.transpose().eval());
  out.estimator = report_iv ? Estimator::kInstrumental : Estimator::kLeastSquares;
  out.vaf = vaf_of(held_out, out.value);
  out.vaf_train = vaf_of(train, out.value);
  const Vector residual = train.tau - train.phi * out.value;
  out.residual_nm.resize(2);
  const double instants = static_cast<double>(train.instants());
  for (Index j = 0; j < 2; ++j) {
    const Vector e = residual(Eigen::seqN(j, train.instants(), 2));
    out.residual_nm[j] = std::sqrt(e.squaredNorm() / instants);
  }
  out.excitation = (train.phi.colwise().squaredNorm() / instants)
                       .cwiseSqrt()
                       .transpose()
                       .cwiseProduct(out.value.cwiseAbs());

  const Feasibility body = feasibility(robot, out.value);
  out.feasible = body.feasible();
  out.least_inertia = body.least_inertia;
  out.least_friction = body.least_friction;
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(out.covariance);
  const Matrix root =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  Index good = 0;
  Random random(0);
  for (Index i = 0; i < kDraws; ++i) {
    Vector normal_draw(p);
    for (Index k = 0; k < p; ++k) normal_draw[k] = random.normal();
    good += feasibility(robot, out.value + root * normal_draw).feasible() ? 1 : 0;
  }
  out.feasible_probability = static_cast<double>(good) / static_cast<double>(kDraws);

  const auto error_of = [&](Index i) { return std::sqrt(std::max(out.covariance(i, i), 0.0)); };
  if (!out.feasible) {
    out.warnings.push_back(
        body.least_inertia <= 0.0
            ? sentence(3,
                       "No body has these parameters: at some pose the inertia has the "
                       "eigenvalue ",
                       body.least_inertia,
                       " kg m^2; record more motion, or check units and signs of the torques.")
            : sentence(3, "Friction would feed energy: its smallest coefficient is ",
                       body.least_friction,
                       "; check the sign of the torques, or leave dry "
                       "friction out."));
  }
  for (Index i = 0; i < p; ++i) {
    if (std::abs(out.value[i]) > 2.0 * error_of(i)) continue;
    out.warnings.push_back(sentence(3, out.names[static_cast<std::size_t>(i)], " = ", out.value[i],
                                    " +- ", error_of(i),
                                    " cannot be told from zero: the motion hardly excites it."));
  }
  if (out.difference_p < kBiasLevel && !report_iv) {
    out.warnings.push_back(
        sentence(2, "Least squares differs from instrumental variables (p = ", out.difference_p,
                 "): noise of the angles or of the controller biases it; use the instruments."));
  }
  const Vector& judged = out.vaf.allFinite() ? out.vaf : out.vaf_train;
  for (Index j = 0; j < 2; ++j) {
    if (judged[j] >= kPoorVaf) continue;
    out.warnings.push_back(sentence(3, "The model accounts for only ", judged[j],
                                    " % of the torque of joint ", j + 1,
                                    ": something else acts on it, as contact, cables or dry "
                                    "friction."));
  }
  out.provenance = record.provenance();
  out.provenance.push_back(sentence(6, "robot parameters of the ", robot.name(), " by ",
                                    report_iv ? "instrumental variables" : "least squares",
                                    ", low pass at ", out.lowpass_hz, " Hz (regressor formed at ",
                                    out.wide_hz, " Hz), first ", out.train_s, " s of every trial"));
  return out;
}

}  // namespace ulna
