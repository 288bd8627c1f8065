#include "impedance/joint.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"
#include "base/words.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

constexpr std::uint64_t kJointStream = 1u << 24;

double condition_of_jacobian(const Matrix& j) {
  const Eigen::JacobiSVD<Matrix> svd(j);
  const Vector& s = svd.singularValues();
  const double least = s[s.size() - 1];
  return least > 0.0 ? s[0] / least : kInfinity;
}

Matrix matrix_at(const Vector& natural, Index first, Index n) {
  Matrix out(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) out(i, j) = natural[first + i * n + j];
  }
  return out;
}

// Gamma_ik = sum_m dJ_mi/dq_k F_m: column k is slope[k]' F.
Matrix gamma_of(const Posture& posture, const Vector& force) {
  const Index n = posture.jacobian.cols();
  Matrix out(n, n);
  for (Index k = 0; k < n; ++k) {
    out.col(k) = posture.slope[static_cast<std::size_t>(k)].transpose() * force;
  }
  return out;
}

// Row by row: vec(L X L') = (L (x) L) vec(X).
Matrix kron(const Matrix& left) {
  const Index r = left.rows();
  const Index c = left.cols();
  Matrix out(r * r, c * c);
  for (Index i = 0; i < r; ++i) {
    for (Index j = 0; j < c; ++j) out.block(i * r, j * c, r, c) = left(i, j) * left;
  }
  return out;
}

void check_inputs(const Vector& natural, const Matrix& covariance, const Vector& force,
                  const Matrix& force_covariance, Index n, Index m) {
  require(natural.size() >= 3 * n * n && natural.head(3 * n * n).allFinite(), "impedance",
          "M, B and K must be finite matrices that fit the Jacobian, " + std::to_string(n) + " x " +
              std::to_string(n));
  require(covariance.size() == 0 ||
              (covariance.rows() == covariance.cols() && covariance.rows() >= 3 * n * n &&
               covariance.topLeftCorner(3 * n * n, 3 * n * n).allFinite()),
          "covariance", "the covariance must be square and hold M, B and K row by row");
  require(force.size() == m && force.allFinite(), "force_n",
          "the force must hold " + std::to_string(m) +
              " finite numbers, one for each row of the Jacobian");
  require(force_covariance.size() == 0 ||
              (force_covariance.rows() == m && force_covariance.cols() == m &&
               force_covariance.allFinite()),
          "force_covariance",
          "the covariance of the force must be square, one row for each component");
}

// Covariance of the three transformed matrices; gamma_slope: d vec_row(K') / d force.
Matrix transformed_covariance(const Matrix& covariance, const Matrix& left,
                              const Matrix& gamma_slope, const Matrix& force_covariance) {
  if (covariance.size() == 0) return {};
  const Matrix one = kron(left);
  const Index to = one.rows();
  const Index from = one.cols();
  Matrix map = Matrix::Zero(3 * to, 3 * from);
  for (Index k = 0; k < 3; ++k) map.block(k * to, k * from, to, from) = one;
  Matrix out = map * covariance.topLeftCorner(3 * from, 3 * from) * map.transpose();
  if (force_covariance.size() > 0) {
    out.bottomRightCorner(to, to) += gamma_slope * force_covariance * gamma_slope.transpose();
  }
  return out;
}

// d vec_row(gamma) / d force.
Matrix gamma_slope_of(const Posture& posture) {
  const Index n = posture.jacobian.cols();
  Matrix out(n * n, posture.jacobian.rows());
  for (Index i = 0; i < n; ++i) {
    for (Index k = 0; k < n; ++k) {
      out.row(i * n + k) = posture.slope[static_cast<std::size_t>(k)].col(i).transpose();
    }
  }
  return out;
}

}  // namespace

void check_posture(const Posture& posture) {
  const Matrix& j = posture.jacobian;
  require(j.rows() >= 1 && j.cols() >= 1 && j.rows() <= 6 && j.cols() <= 12 && j.allFinite(),
          "jacobian", "the Jacobian must be finite, 1 to 6 rows and 1 to 12 columns");
  require(static_cast<Index>(posture.slope.size()) == j.cols(), "jacobian_slope",
          "the derivative of the Jacobian needs a matrix for each of the " +
              std::to_string(j.cols()) + " joints");
  double largest = 0.0;
  for (const Matrix& slope : posture.slope) {
    require(slope.rows() == j.rows() && slope.cols() == j.cols() && slope.allFinite(),
            "jacobian_slope", "every derivative of the Jacobian must be finite and have its shape");
    largest = std::max(largest, slope.cwiseAbs().maxCoeff());
  }
  for (Index i = 0; i < j.cols(); ++i) {
    for (Index k = 0; k < i; ++k) {
      const double apart = (posture.slope[static_cast<std::size_t>(k)].col(i) -
                            posture.slope[static_cast<std::size_t>(i)].col(k))
                               .cwiseAbs()
                               .maxCoeff();
      require(apart <= 1e-6 * largest, "jacobian_slope",
              "the derivatives are of no Jacobian: column " + std::to_string(i) + " of dJ/dq" +
                  std::to_string(k) + " must be column " + std::to_string(k) + " of dJ/dq" +
                  std::to_string(i));
    }
  }
}

Posture posture_of(const TwoLink& arm, const Eigen::Vector2d& q) {
  check_arm(arm);
  require(q.allFinite(), "angles_rad", "the joint angles must be numbers");
  const auto slope = jacobian_slope(arm, q);
  return {jacobian_of(arm, q), {slope[0], slope[1]}};
}

JointImpedance to_joint(const Vector& natural, const Matrix& covariance, const Posture& posture,
                        const Vector& force, const Matrix& force_covariance) {
  check_posture(posture);
  const Matrix& j = posture.jacobian;
  const Index m = j.rows();
  check_inputs(natural, covariance, force, force_covariance, m, m);
  JointImpedance out;
  out.condition = condition_of_jacobian(j);
  out.gamma = gamma_of(posture, force);
  const Matrix left = j.transpose();
  out.m = left * matrix_at(natural, 0, m) * j;
  out.b = left * matrix_at(natural, m * m, m) * j;
  out.k = left * matrix_at(natural, 2 * m * m, m) * j - out.gamma;
  out.covariance =
      transformed_covariance(covariance, left, gamma_slope_of(posture), force_covariance);
  return out;
}

JointImpedance to_endpoint(const Vector& natural, const Matrix& covariance, const Posture& posture,
                           const Vector& force, const Matrix& force_covariance,
                           double condition_limit) {
  check_posture(posture);
  const Matrix& j = posture.jacobian;
  const Index n = j.cols();
  JointImpedance out;
  out.condition = condition_of_jacobian(j);
  if (j.rows() != n) {
    throw Error(Fault::kAnalysis, "jacobian",
                "a Jacobian of " + std::to_string(j.rows()) + " x " + std::to_string(n) +
                    " cannot be inverted: the joints' impedance does not determine the hand's");
  }
  if (!(out.condition <= condition_limit)) {
    const Eigen::JacobiSVD<Matrix> svd(j, Eigen::ComputeFullU);
    const Vector weak = svd.matrixU().col(n - 1);
    std::string direction;
    for (Index i = 0; i < n; ++i) direction += sentence(3, i == 0 ? "" : ", ", weak[i]);
    throw Error(Fault::kAnalysis, "jacobian",
                sentence(3, "the posture is singular (condition number ", out.condition,
                         "): the hand cannot move along (", direction,
                         "), so its impedance there is unbounded"));
  }
  check_inputs(natural, covariance, force, force_covariance, n, n);
  out.gamma = gamma_of(posture, force);
  const Matrix left = j.inverse().transpose();
  out.m = left * matrix_at(natural, 0, n) * left.transpose();
  out.b = left * matrix_at(natural, n * n, n) * left.transpose();
  out.k = left * (matrix_at(natural, 2 * n * n, n) + out.gamma) * left.transpose();
  out.covariance = transformed_covariance(covariance, left, kron(left) * gamma_slope_of(posture),
                                          force_covariance);
  return out;
}

JointPassivity joint_passivity(const JointImpedance& impedance, double level, Index draws,
                               std::uint64_t seed) {
  require(level > 0.0 && level < 1.0, "level", "the level must lie between 0 and 1");
  require(draws >= 100 && draws <= 1'000'000, "draws", "from 100 to a million draws are made");
  const Index n = impedance.m.rows();
  require(n >= 1 && n <= 12, "m", "M, B and K must have from 1 to 12 rows");
  const auto least = [](const Matrix& z) {
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(0.5 * (z + z.transpose()),
                                                       Eigen::EigenvaluesOnly);
    return solver.eigenvalues()[0];
  };
  JointPassivity out;
  const Matrix* const matrices[3] = {&impedance.m, &impedance.b, &impedance.k};
  bool passive = true;
  for (int k = 0; k < 3; ++k) {
    out.value[k] = least(*matrices[k]);
    out.interval[k][0] = out.interval[k][1] = out.value[k];
    passive = passive && out.value[k] >= 0.0;
  }
  out.probability = passive ? 1.0 : 0.0;
  if (impedance.covariance.size() == 0) return out;
  Vector mean(3 * n * n);
  for (Index k = 0; k < 3; ++k) {
    for (Index i = 0; i < n; ++i) {
      mean.segment(k * n * n + i * n, n) = matrices[k]->row(i).transpose();
    }
  }
  const Eigen::SelfAdjointEigenSolver<Matrix> spread(impedance.covariance);
  const Matrix root =
      spread.eigenvectors() * spread.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  std::vector<double> values[3];
  Index good = 0;
  for (Index draw = 0; draw < draws; ++draw) {
    Random random(seed, kJointStream + static_cast<std::uint64_t>(draw));
    Vector normal(mean.size());
    for (Index i = 0; i < normal.size(); ++i) normal[i] = random.normal();
    const Vector sample = mean + root * normal;
    bool all = true;
    for (Index k = 0; k < 3; ++k) {
      const double value = least(matrix_at(sample, k * n * n, n));
      values[k].push_back(value);
      all = all && value >= 0.0;
    }
    if (all) ++good;
  }
  out.probability = static_cast<double>(good) / static_cast<double>(draws);
  for (int k = 0; k < 3; ++k) {
    out.interval[k][0] = sample_quantile(values[k], 0.5 * (1.0 - level));
    out.interval[k][1] = sample_quantile(values[k], 0.5 * (1.0 + level));
  }
  return out;
}

Record joint_record(const Record& record, const Roles& roles, const TwoLink& arm,
                    const Matrix& angles, double condition_limit) {
  check_arm(arm);
  require(roles.position.size() == 2 && roles.force.size() == 2, "record",
          "a planar arm needs positions and forces along two axes; the record names " +
              std::to_string(roles.position.size()) + " positions");
  require(roles.reference.empty() || roles.reference.size() == 2, "reference",
          "a reference must have two axes, or none");
  const Index rows = record.rows();
  require(angles.size() == 0 || (angles.rows() == rows && angles.cols() == 2), "angles_rad",
          "the joint angles must have a row for each of the record's " + std::to_string(rows) +
              " and two columns");
  const bool referenced = !roles.reference.empty();
  Record::Parts parts;
  parts.time = record.time();
  parts.trials = record.trials();
  parts.segments = record.segments();
  parts.rate_hz = record.rate_hz();
  parts.provenance = record.provenance();
  parts.values.resize(rows, referenced ? 6 : 4);
  const auto at_row = [&](Index row, const auto& make) {
    try {
      return make();
    } catch (const Error& error) {
      const std::string place = "row " + std::to_string(row);
      throw Error(error.fault(), error.argument(), place + ": " + error.what(), place);
    }
  };
  std::vector<bool> starts(static_cast<std::size_t>(rows), false);  // of trials
  for (const Trial& trial : record.trials()) starts[static_cast<std::size_t>(trial.begin)] = true;
  std::vector<Eigen::Vector2d> before(2, Eigen::Vector2d::Zero());
  const auto unwrapped = [&](Eigen::Vector2d q, std::size_t which, Index row) {
    if (!starts[static_cast<std::size_t>(row)]) {
      for (Index k = 0; k < 2; ++k) {
        q[k] = before[which][k] + std::remainder(q[k] - before[which][k], 2.0 * kPi);
      }
    }
    before[which] = q;
    return q;
  };
  for (Index row = 0; row < rows; ++row) {
    const auto pair = [&](const std::vector<Index>& channels) {
      const Eigen::Vector2d value(record.values()(row, channels[0]),
                                  record.values()(row, channels[1]));
      if (!value.allFinite()) {
        const std::string place = "row " + std::to_string(row);
        throw Error(Fault::kData, "record",
                    "channel " + record.channels()[static_cast<std::size_t>(channels[0])].name +
                        " or its neighbour has no number at " + place + ": split or repair it",
                    place);
      }
      return value;
    };
    Eigen::Vector2d q;
    if (angles.size() > 0) {
      q = angles.row(row).transpose();
      require(q.allFinite(), "angles_rad",
              "the angle at row " + std::to_string(row) + " is no number");
    } else {
      q = unwrapped(at_row(row, [&] { return angles_of(arm, pair(roles.position)); }), 0, row);
    }
    const Eigen::Matrix2d j = jacobian_of(arm, q);
    const double condition = condition_of_jacobian(j);
    if (!(condition <= condition_limit)) {
      throw Error(
          Fault::kAnalysis, "arm",
          sentence(3, "the arm is singular at row ", row, ": the elbow is at ", 180.0 / kPi * q[1],
                   " degrees (condition number ", condition, "), leave those rows out"),
          "row " + std::to_string(row));
    }
    parts.values.row(row).head(2) = q.transpose();
    parts.values.row(row).segment(2, 2) = (j.transpose() * pair(roles.force)).transpose();
    if (referenced) {
      parts.values.row(row).tail(2) =
          unwrapped(at_row(row, [&] { return angles_of(arm, pair(roles.reference)); }), 1, row)
              .transpose();
    }
  }
  const auto add = [&](const char* name, const char* unit, Role role, int axis) {
    Channel channel;
    channel.name = name;
    channel.unit = unit;
    channel.role = role;
    channel.axis = axis;
    channel.source_name = name;
    channel.source_unit = unit;
    parts.channels.push_back(std::move(channel));
  };
  add("q1", "rad", Role::kPosition, 0);
  add("q2", "rad", Role::kPosition, 1);
  add("tau1", "Nm", Role::kForce, 0);
  add("tau2", "Nm", Role::kForce, 1);
  if (referenced) {
    add("q1_ref", "rad", Role::kReference, 0);
    add("q2_ref", "rad", Role::kReference, 1);
  }
  parts.provenance.push_back(sentence(6, "to joints of a planar ", arm.left ? "left" : "right",
                                      " arm: upper arm ", arm.upper_m, " m, forearm ", arm.fore_m,
                                      " m, shoulder at (", arm.shoulder_x_m, ", ", arm.shoulder_y_m,
                                      ") m", angles.size() > 0 ? ", angles as given" : ""));
  return Record::make(std::move(parts));
}

}  // namespace ulna
