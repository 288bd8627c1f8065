#include "impedance/viscoelastic.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"
#include "base/words.hpp"
#include "signal/finite.hpp"
#include "signal/savgol.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

constexpr int kAnglePowers = 6;                 // of the smooth misfit
constexpr double kLeastMotion = 1.0 * kDegree;  // of a joint that is assessed
constexpr int kRatePowers = 3;
constexpr double kPoorShare = 0.5;  // of the variance that a line must explain

bool has_channel(const Record& record, const std::string& name) {
  return std::any_of(record.channels().begin(), record.channels().end(),
                     [&](const Channel& c) { return c.name == name; });
}

// Rows of a channel; refuses what is not finite with the row.
Vector finite_column(const Record& record, const std::string& name) {
  const Vector values = record.column(record.find(name));
  for (Index i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) continue;
    throw Error(Fault::kData, name,
                "channel " + name + " is not finite in row " + std::to_string(i) +
                    ": remove the row or the trial",
                "row " + std::to_string(i));
  }
  return values;
}

Matrix joint_channels(const Record& record, const char* prefix,
                      const std::vector<std::string>& joints) {
  Matrix values(record.rows(), static_cast<Index>(joints.size()));
  for (Index j = 0; j < values.cols(); ++j) {
    values.col(j) = finite_column(record, prefix + joints[static_cast<std::size_t>(j)]);
  }
  return values;
}

// Motion and motor torque of the device.
struct DeviceLog {
  Matrix angle, rate, acceleration, motor;
  Matrix loss;  // empty: not logged
};

// A window of 0.11 s passes 5 Hz at order 4.
SavgolSpec smoother_of(double rate_hz) {
  const int half = std::max(3, static_cast<int>(std::lround(0.055 * rate_hz)));
  return {.window = 2 * half + 1, .order = 4};
}

void smooth_trials(const Record& record, const Matrix& from, int derivative, Matrix& to) {
  const SavgolSpec spec = smoother_of(record.rate_hz());
  for (const Trial& trial : record.trials()) {
    const Index rows = trial.end - trial.begin;
    Matrix out(rows, derivative + 1);
    for (Index j = 0; j < from.cols(); ++j) {
      const Vector column = from.col(j).segment(trial.begin, rows);
      savgol_apply(spec, record.rate_hz(), column, derivative, out);
      to.col(j).segment(trial.begin, rows) = out.col(derivative);
    }
  }
}

DeviceLog device_log(const Record& record, const std::vector<std::string>& joints,
                     bool needs_acceleration) {
  DeviceLog log;
  log.angle = joint_channels(record, "theta_", joints);
  log.motor = joint_channels(record, "tau_motor_", joints);
  const bool rates = has_channel(record, "theta_dot_" + joints[0]);
  const bool accelerations = has_channel(record, "theta_ddot_" + joints[0]);
  if (rates) log.rate = joint_channels(record, "theta_dot_", joints);
  if (accelerations) log.acceleration = joint_channels(record, "theta_ddot_", joints);
  if (rates && (accelerations || !needs_acceleration)) {
    if (!accelerations) log.acceleration = Matrix::Zero(log.angle.rows(), log.angle.cols());
    if (has_channel(record, "tau_loss_" + joints[0])) {
      log.loss = joint_channels(record, "tau_loss_", joints);
    }
    return log;
  }
  const Matrix raw = log.angle;
  const Matrix motor = log.motor;
  for (Matrix* m : {&log.rate, &log.acceleration}) m->resize(raw.rows(), raw.cols());
  smooth_trials(record, raw, 0, log.angle);
  smooth_trials(record, raw, 1, log.rate);
  smooth_trials(record, raw, 2, log.acceleration);
  smooth_trials(record, motor, 0, log.motor);
  return log;
}

Matrix torque_of(const DeviceLog& log, const NominalModel& nominal, const NominalTerms& terms) {
  Matrix torque(log.angle.rows(), log.angle.cols());
  NominalTerms bodies = terms;
  const bool logged =
      log.loss.size() > 0 && terms.damping && terms.friction == NominalFriction::kEngine;
  if (logged) {
    bodies.damping = false;
    bodies.friction = NominalFriction::kNone;
  }
  for (Index i = 0; i < torque.rows(); ++i) {
    const Vector angle = log.angle.row(i).transpose();
    const Vector rate = log.rate.row(i).transpose();
    const Vector acceleration = log.acceleration.row(i).transpose();
    torque.row(i) =
        nominal.torque(angle, rate, acceleration, bodies).transpose() - log.motor.row(i);
  }
  if (logged) torque += log.loss;
  return torque;
}

// Regressors: angle, then rate and one where they are wanted.
Matrix regressors_of(const Vector& angle, const Vector& rate, const ViscoelasticOptions& o) {
  Matrix x(angle.size(), 1 + (o.damping ? 1 : 0) + (o.intercept ? 1 : 0));
  Index c = 0;
  x.col(c++) = angle;
  if (o.damping) x.col(c++) = rate;
  if (o.intercept) x.col(c++).setOnes();
  return x;
}

struct Line {
  Vector theta;
  Matrix inverse;  // of the Gram matrix
  double condition = kInfinity;
};

Line fit_line(const Matrix& x, const Vector& y) {
  Line line;
  Vector scale = x.colwise().norm().transpose();
  for (Index c = 0; c < scale.size(); ++c) {
    if (!(scale[c] > 0.0)) return line;
  }
  const Matrix unit = x * scale.cwiseInverse().asDiagonal();
  const Eigen::JacobiSVD<Matrix> svd(unit, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Vector values = svd.singularValues();
  const double least = values[values.size() - 1];
  line.condition = least > 0.0 ? values[0] / least : kInfinity;
  line.theta = scale.cwiseInverse().cwiseProduct(svd.solve(y));
  const Matrix back = scale.cwiseInverse().asDiagonal() * svd.matrixV();
  line.inverse = back * values.cwiseAbs2().cwiseInverse().asDiagonal() * back.transpose();
  return line;
}

// A line and smooth functions of angle and rate: what is left is no property of the arm.
Matrix smooth_basis(const Matrix& x, const Vector& angle, const Vector& rate) {
  const auto scaled = [](const Vector& v) {
    const double low = v.minCoeff();
    const double half = 0.5 * (v.maxCoeff() - low);
    return Vector((v.array() - low) / std::max(half, 1e-300) - 1.0);
  };
  const Vector u = scaled(angle);
  const Vector w = scaled(rate);
  Matrix basis(x.rows(), x.cols() + kAnglePowers + kRatePowers + 1);
  basis.leftCols(x.cols()) = x;
  Index c = x.cols();
  // Chebyshev polynomials: powers of one variable are nearly the same.
  const auto add = [&](const Vector& v, int degrees) {
    Vector before = Vector::Ones(v.size());
    Vector now = v;
    for (int p = 2; p <= degrees + 1; ++p) {
      const Vector next = 2.0 * v.cwiseProduct(now) - before;
      before = now;
      now = next;
      basis.col(c++) = now;
    }
  };
  add(u, kAnglePowers);
  add(w, kRatePowers);
  basis.col(c) = u.cwiseProduct(w);
  return basis;
}

struct Left {
  Vector values;
  Matrix space;  // orthonormal columns: what was taken off
};

Left left_by(const Matrix& basis, const Vector& y) {
  Eigen::ColPivHouseholderQR<Matrix> qr(basis);
  qr.setThreshold(1e-8);
  Left left;
  left.space = qr.householderQ() * Matrix::Identity(basis.rows(), qr.rank());
  left.values = y - left.space * (left.space.transpose() * y);
  return left;
}

// (X'X)^-1 X' Omega X (X'X)^-1 with the errors' covariance by Newey and West, within each trial.
Matrix hac_covariance(const Record& record, const Matrix& x, const Vector& errors,
                      const Matrix& inverse, Index lag) {
  const Matrix scores = x.array().colwise() * errors.array();
  Matrix meat = Matrix::Zero(x.cols(), x.cols());
  for (const Trial& trial : record.trials()) {
    const Index rows = trial.end - trial.begin;
    const auto s = scores.middleRows(trial.begin, rows);
    meat += s.transpose() * s;
    for (Index l = 1; l <= std::min(lag, rows - 1); ++l) {
      const Matrix g = s.bottomRows(rows - l).transpose() * s.topRows(rows - l);
      const double weight = 1.0 - static_cast<double>(l) / static_cast<double>(lag + 1);
      meat += weight * (g + g.transpose());
    }
  }
  return inverse * meat * inverse;
}

// Parameters refitted to the line and resampled blocks of the errors.
Matrix bootstrap_replicates(const Matrix& x, const Vector& errors, const Matrix& inverse,
                            const ViscoelasticOptions& o, Index block, Token* token) {
  const Index rows = x.rows();
  const Matrix project = inverse * x.transpose();
  Matrix replicates(o.bootstrap, x.cols());
  Vector drawn(rows);
  for (Index i = 0; i < o.bootstrap; ++i) {
    step(token, static_cast<double>(i) / static_cast<double>(o.bootstrap));
    Random random(o.seed, static_cast<std::uint64_t>(i));
    for (Index at = 0; at < rows; at += block) {
      const Index from = random.below(rows - block + 1);
      const Index count = std::min(block, rows - at);
      drawn.segment(at, count) = errors.segment(from, count);
    }
    // Blocks of a whole that has no mean have one each.
    drawn.array() -= drawn.mean();
    replicates.row(i) = (project * drawn).transpose();
  }
  return replicates;
}

// What the covariance above would be on average for white errors of variance 1, from which the
// columns of `space` were taken.
Matrix white_expectation(const Record& record, const Matrix& x, const Matrix& space,
                         const Matrix& inverse, Index lag) {
  Matrix meat = Matrix::Zero(x.cols(), x.cols());
  for (const Trial& trial : record.trials()) {
    const Index rows = trial.end - trial.begin;
    const auto q = space.middleRows(trial.begin, rows);
    const auto z = x.middleRows(trial.begin, rows);
    for (Index l = 0; l <= std::min(lag, rows - 1); ++l) {
      Vector left = -q.bottomRows(rows - l).cwiseProduct(q.topRows(rows - l)).rowwise().sum();
      if (l == 0) left.array() += 1.0;
      const Matrix g = z.bottomRows(rows - l).transpose() * left.asDiagonal() * z.topRows(rows - l);
      const double weight = 1.0 - static_cast<double>(l) / static_cast<double>(lag + 1);
      meat += l == 0 ? g : Matrix(weight * (g + g.transpose()));
    }
  }
  return inverse * meat * inverse;
}

// Taking off a line and smooth functions takes off the slow part of the errors, which is what the
// line is sensitive to. For white errors the loss is known: the factor by which each standard error
// was too small.
Vector lost_share(const Record& record, const Matrix& x, const Left& left, const Line& line,
                  Index lag) {
  const Matrix kept = white_expectation(record, x, left.space, line.inverse, lag);
  return line.inverse.diagonal()
      .cwiseQuotient(kept.diagonal().cwiseMax(1e-2 * line.inverse.diagonal()))
      .cwiseSqrt();
}

struct Errors {
  Vector error;
  Vector half_low, half_high;  // below and above the estimate
};

Index rows_of_seconds(const Record& record, double seconds, Index least, Index most) {
  return std::clamp<Index>(static_cast<Index>(std::lround(seconds * record.rate_hz())), least,
                           std::max(least, most));
}

// With lags of a share b of the rows, the variance by Bartlett weights varies like that of
// Student's t with 1.5 / b degrees of freedom (Kiefer and Vogelsang 2005, to first order in b).
Errors hac_errors(const Record& record, const Matrix& x, const Left& left, const Line& line,
                  const ViscoelasticOptions& o) {
  Index longest = 0;
  for (const Trial& trial : record.trials()) longest = std::max(longest, trial.end - trial.begin);
  const Index lag = rows_of_seconds(record, o.hac_lag_s, 0, longest / 4);
  const Matrix covariance = hac_covariance(record, x, left.values, line.inverse, lag);
  Errors e;
  e.error = covariance.diagonal().cwiseMax(0.0).cwiseSqrt().cwiseProduct(
      lost_share(record, x, left, line, lag));
  const auto rows = static_cast<double>(x.rows());
  const double dof = std::min(1.5 * rows / static_cast<double>(lag + 1),
                              std::max(1.0, rows - static_cast<double>(left.space.cols())));
  e.half_high = student_quantile(0.5 + 0.5 * o.level, dof) * e.error;
  e.half_low = e.half_high;
  return e;
}

Errors bootstrap_errors(const Record& record, const Matrix& x, const Left& left, const Line& line,
                        const ViscoelasticOptions& o, Token* token) {
  const Index rows = x.rows();
  const Index block = rows_of_seconds(record, o.block_s, 1, rows);
  if (rows / block < 5) {
    throw Error(Fault::kData, "errors",
                "a bootstrap over " + std::to_string(rows / block) +
                    " blocks says nothing: shorten block_s or use Newey-West errors");
  }
  // Blocks keep a lag l in one of 1 - l / block of the places, which are Bartlett's weights.
  const Vector lost = lost_share(record, x, left, line, block - 1);
  const Matrix replicates =
      bootstrap_replicates(x, left.values, line.inverse, o, block, token) * lost.asDiagonal();
  Errors e;
  const Matrix centred = replicates.rowwise() - replicates.colwise().mean();
  e.error =
      (centred.colwise().squaredNorm().transpose() / static_cast<double>(replicates.rows() - 1))
          .cwiseSqrt();
  e.half_low.resize(x.cols());
  e.half_high.resize(x.cols());
  for (Index c = 0; c < x.cols(); ++c) {
    const std::vector<double> sample(replicates.col(c).data(),
                                     replicates.col(c).data() + replicates.rows());
    // The estimate less the true value is distributed as a replicate less the estimate.
    e.half_low[c] = sample_quantile(sample, 0.5 + 0.5 * o.level);
    e.half_high[c] = -sample_quantile(sample, 0.5 - 0.5 * o.level);
  }
  return e;
}

void check_options(const ViscoelasticOptions& o) {
  const auto positive = [](double value, const char* argument) {
    require(std::isfinite(value) && value > 0.0, argument,
            std::string(argument) + " must be a positive number");
  };
  positive(o.hac_lag_s, "hac_lag_s");
  positive(o.block_s, "block_s");
  positive(o.condition_limit, "condition_limit");
  require(o.level > 0.5 && o.level < 1.0, "level", "level must be between 0.5 and 1");
  require(o.bootstrap >= 50 && o.bootstrap <= 10'000'000, "bootstrap",
          "bootstrap must be between 50 and ten million");
}

std::vector<Index> chosen_joints(const Record& record, const NominalModel& nominal,
                                 const ViscoelasticOptions& o) {
  const std::vector<std::string>& joints = nominal.joints();
  std::vector<Index> chosen;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Index c = record.find("theta_" + joints[j]);
    const bool moved = record.channels()[static_cast<std::size_t>(c)].role == Role::kPosition;
    const bool named = std::find(o.joints.begin(), o.joints.end(), joints[j]) != o.joints.end();
    if (o.joints.empty() ? moved : named) chosen.push_back(static_cast<Index>(j));
  }
  for (const std::string& name : o.joints) {
    require(std::find(joints.begin(), joints.end(), name) != joints.end(), "joints",
            "the device has no joint '" + name + "'; its joints are: " + join(joints));
  }
  require(!chosen.empty(), "joints",
          "no channel theta_<joint> has the role position: name the joints to "
          "assess");
  return chosen;
}

// Channels of the human joint that a device joint turns: of the same name in a rigid coupling, else
// the one whose torque of the muscles is there. "" where the record does not say.
std::string human_of(const Record& record, const std::string& joint, bool last) {
  if (has_channel(record, "q_" + joint)) return joint;
  return last && has_channel(record, "q_elbow_flexion") ? "elbow_flexion" : "";
}

void set_truth(const Record& record, const std::string& human, const Vector& torque,
               const ViscoelasticOptions& o, Viscoelasticity& v) {
  if (human.empty() || !has_channel(record, "tau_muscle_" + human)) return;
  const Vector muscle = finite_column(record, "tau_muscle_" + human);
  const Vector q = finite_column(record, "q_" + human);
  const Vector q_dot = finite_column(record, "q_dot_" + human);
  const Line line = fit_line(regressors_of(q, q_dot, o), muscle);
  ViscoelasticOptions alone = o;
  alone.damping = false;
  alone.intercept = true;
  const Line slope = fit_line(regressors_of(q, q_dot, alone), muscle);
  v.truth.known = true;
  if (line.theta.size() > 0) v.truth.k = -line.theta[0];
  if (line.theta.size() > 0 && o.damping) v.truth.d = -line.theta[1];
  if (slope.theta.size() > 0) v.truth.k_alone = -slope.theta[0];
  const Vector residual = torque - muscle;
  v.model_residual_rms = std::sqrt(residual.squaredNorm() / static_cast<double>(residual.size()));
  v.model_residual_max = residual.cwiseAbs().maxCoeff();
}

Viscoelasticity assess_joint(const Record& record, const std::string& joint, bool last,
                             const Vector& theta, const Vector& theta_dot, const Vector& torque,
                             const ViscoelasticOptions& o, Token* token) {
  Viscoelasticity v;
  v.joint = joint;
  v.level = o.level;
  v.rows = torque.size();
  const std::string human = human_of(record, joint, last);
  require(!o.human_angle || !human.empty(), "human_angle",
          "the record holds no true human angle q_ for joint '" + joint + "'");
  const Vector angle = o.human_angle ? finite_column(record, "q_" + human) : theta;
  const Vector rate = o.human_angle ? finite_column(record, "q_dot_" + human) : theta_dot;
  const Matrix x = regressors_of(angle, rate, o);
  if (v.rows < 10 * x.cols()) {
    throw Error(Fault::kData, "record",
                "only " + std::to_string(v.rows) + " rows are there to identify " +
                    std::to_string(x.cols()) + " parameters of joint '" + joint + "'; at least " +
                    std::to_string(10 * x.cols()) + " are needed");
  }
  const double way = angle.maxCoeff() - angle.minCoeff();
  if (!(way >= kLeastMotion)) {
    throw Error(Fault::kAnalysis, "record",
                sentence(3, "joint '", joint, "' moves by ", way / kDegree,
                         " degrees, which does not determine its stiffness: "
                         "move it further"),
                "joint " + joint);
  }
  const Line line = fit_line(x, torque);
  v.condition = line.condition;
  if (!(line.condition <= o.condition_limit)) {
    throw Error(Fault::kAnalysis, "record",
                sentence(3, "the movement of joint '", joint,
                         "' does not determine its stiffness and damping (condition number ",
                         line.condition, ", limit ", o.condition_limit, "): move it further"),
                "joint " + joint);
  }
  v.k = -line.theta[0];
  if (o.damping) v.d = -line.theta[1];
  if (o.intercept) v.offset = line.theta[x.cols() - 1];
  const Left plain = left_by(x, torque);
  const Left noise = left_by(smooth_basis(x, angle, rate), torque);
  const auto rows = static_cast<double>(v.rows);
  const double about = o.intercept ? torque.mean() : 0.0;
  v.r_squared = 1.0 - plain.values.squaredNorm() /
                          std::max(1e-300, (torque.array() - about).matrix().squaredNorm());
  v.residual_rms = std::sqrt(plain.values.squaredNorm() / rows);
  v.noise_rms = std::sqrt(noise.values.squaredNorm() / rows);
  const Left& left = o.count_misfit ? plain : noise;
  const Errors e = o.errors == ErrorModel::kNeweyWest
                       ? hac_errors(record, x, left, line, o)
                       : bootstrap_errors(record, x, left, line, o, token);
  v.k_error = e.error[0];
  // K is minus the slope: low and high change their places.
  v.k_interval[0] = v.k - e.half_high[0];
  v.k_interval[1] = v.k + e.half_low[0];
  if (o.damping) {
    v.d_error = e.error[1];
    v.d_interval[0] = v.d - e.half_high[1];
    v.d_interval[1] = v.d + e.half_low[1];
  }
  set_truth(record, human, torque, o, v);
  if (v.r_squared < kPoorShare) {
    v.warnings.push_back(sentence(3, "A line explains ", 100.0 * v.r_squared,
                                  " % of the torque of joint '", joint,
                                  "': stiffness and damping are averages of what changes along "
                                  "the movement."));
  }
  if (v.k_interval[1] < 0.0) {
    v.warnings.push_back("The torque of joint '" + joint +
                         "' grows with the angle: the muscles pull like an anti-spring (K < 0), "
                         "not like a resistance.");
  }
  return v;
}

}  // namespace

ViscoelasticOptions ViscoelasticOptions::published() {
  ViscoelasticOptions o;
  o.terms = {.inertia = false, .damping = false, .friction = NominalFriction::kNone};
  o.human_angle = true;
  o.damping = false;
  return o;
}

Matrix nominal_human_torque(const Record& record, const NominalModel& nominal,
                            const NominalTerms& terms) {
  return torque_of(device_log(record, nominal.joints(), true), nominal, terms);
}

std::vector<Viscoelasticity> identify_viscoelasticity(const Record& record,
                                                      const NominalModel& nominal,
                                                      const ViscoelasticOptions& options,
                                                      Token* token) {
  check_options(options);
  const std::vector<Index> chosen = chosen_joints(record, nominal, options);
  const bool accelerated =
      options.terms.inertia || options.terms.friction == NominalFriction::kEngine;
  const DeviceLog log = device_log(record, nominal.joints(), accelerated);
  const Matrix torque = torque_of(log, nominal, options.terms);
  std::vector<Viscoelasticity> found;
  for (const Index j : chosen) {
    found.push_back(assess_joint(record, nominal.joints()[static_cast<std::size_t>(j)],
                                 j + 1 == torque.cols(), log.angle.col(j), log.rate.col(j),
                                 torque.col(j), options, token));
  }
  step(token, 1.0);
  return found;
}

}  // namespace ulna
