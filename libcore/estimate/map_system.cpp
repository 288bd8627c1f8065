#include "estimate/map_system.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>

namespace ulna {
namespace {

using Triplets = std::vector<Eigen::Triplet<double>>;

template <class M>
void put(Triplets& entries, Index row, Index column, const M& block) {
  for (Index r = 0; r < block.rows(); ++r) {
    for (Index c = 0; c < block.cols(); ++c) {
      if (block(r, c) != 0.0) {
        entries.emplace_back(static_cast<int>(row + r), static_cast<int>(column + c), block(r, c));
      }
    }
  }
}

Matrix3 skew(const Vector3& v) {
  Matrix3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

// Takes (acceleration of a point, angular) to the same of a point displaced by r, in turned axes.
Matrix6 shift(const Matrix3& turn, const Vector3& r) {
  Matrix6 m;
  m << turn, -turn * skew(r), Matrix3::Zero(), turn;
  return m;
}

SparseMatrix sparse(const Triplets& entries, Index rows, Index columns) {
  SparseMatrix m(rows, columns);
  m.setFromTriplets(entries.begin(), entries.end());
  return m;
}

void put_dynamics(const BodyTree& body, const BodyState& state, const BodyMotion& motion,
                  const MapLayout& at, MapSystem& system) {
  Triplets entries;
  system.dynamics_bias.setZero(12 * at.links - 6);
  for (Index i = 0; i < at.links; ++i) {
    const BodyLink& link = body.link(i);
    const Matrix3& axes = motion.link(i).axes;
    const Vector3 w = axes.transpose() * motion.link(i).turn;
    const Matrix3 c = skew(link.centre);
    Matrix6 inertia;
    inertia << link.mass * Matrix3::Identity(), -link.mass * c, link.mass * c,
        link.inertia - link.mass * c * c;
    const Index row = 6 * i;
    put(entries, row, at.acceleration(i), inertia);
    put(entries, row, at.external(i), Matrix6(-Matrix6::Identity()));
    const Vector3 force = link.mass * w.cross(w.cross(link.centre));
    system.dynamics_bias.segment<3>(row) = force;
    system.dynamics_bias.segment<3>(row + 3) = w.cross(link.inertia * w) + link.centre.cross(force);
    if (i == 0) continue;
    put(entries, row, at.joint_wrench(i), Matrix6(-Matrix6::Identity()));
    const Index p = link.parent;
    const Matrix3 turn = axes.transpose() * motion.link(p).axes;
    const Matrix6 x = shift(turn, link.position);
    put(entries, 6 * p, at.joint_wrench(i), Matrix6(x.transpose()));
    const Index joint = 6 * at.links + 6 * (i - 1);
    put(entries, joint, at.acceleration(i), Matrix6(Matrix6::Identity()));
    put(entries, joint, at.acceleration(p), Matrix6(-x));
    const Vector3 wp = motion.link(p).axes.transpose() * motion.link(p).turn;
    system.dynamics_bias.segment<3>(joint) = -turn * wp.cross(wp.cross(link.position));
    if (body.dof(i) < 0) continue;
    Vector6 hinge = Vector6::Zero();
    hinge.tail<3>() = -link.axis;
    put(entries, joint, at.joint_acceleration(body.dof(i)), hinge);
    system.dynamics_bias.segment<3>(joint + 3) =
        -(turn * wp).cross(link.axis) * state.rate[body.dof(i)];
  }
  system.dynamics = sparse(entries, 12 * at.links - 6, at.unknowns());
}

// Wrench and covariance of a contact, about the origin of its link, link axes.
void add_contact(const BodySensor& sensor, const BodyPrior& prior, const BodyState& state,
                 const LinkMotion& link, const VectorRef& y, Index row, Vector6& mean,
                 Matrix6& covariance) {
  Matrix3 axes = sensor.orientation;  // of the sensor, link axes
  Vector3 at = sensor.position;
  if (sensor.frame != SensorFrame::kLink) axes = link.axes.transpose() * sensor.orientation;
  if (sensor.frame == SensorFrame::kWorld) {
    at = link.axes.transpose() * (sensor.position - state.position - link.origin);
  }
  Matrix6 frame;
  frame << axes, Matrix3::Zero(), skew(at) * axes, axes;
  const bool measured = sensor_rows(sensor.kind) > 0;
  for (Index k = 0; k < sensor.deviation.size(); ++k) {
    double deviation = sensor.deviation[k];
    if (measured && std::isfinite(y[row + k])) {
      mean += frame.col(k) * y[row + k];
    } else if (measured) {
      deviation = k < 3 ? prior.force : prior.moment;
    }
    covariance += deviation * deviation * frame.col(k) * frame.col(k).transpose();
  }
}

}  // namespace

MapSystem map_system(const SensorSuite& suite, const BodyState& state, const VectorRef& y) {
  using Kind = BodySensorKind;
  const BodyTree& body = suite.body();
  const BodyPrior& prior = suite.prior();
  const MapLayout at(body);
  BodyMotion motion(suite.shared_body());
  motion.move(state);
  MapSystem system;
  put_dynamics(body, state, motion, at, system);

  Triplets entries;
  Triplets weights;
  std::vector<double> bias;
  std::vector<double> measured;
  const auto add = [&](Index column, const auto& row, double known, double value,
                       double deviation) {
    if (!std::isfinite(value)) return;
    const auto r = static_cast<Index>(bias.size());
    put(entries, r, column, row);
    weights.emplace_back(static_cast<int>(r), static_cast<int>(r), 1.0 / (deviation * deviation));
    bias.push_back(known);
    measured.push_back(value);
  };
  std::vector<Vector6> mean(static_cast<std::size_t>(at.links), Vector6::Zero());
  std::vector<Matrix6> covariance(static_cast<std::size_t>(at.links), Matrix6::Zero());
  for (Matrix6& c : covariance) {
    c.diagonal().head<3>().setConstant(prior.untouched_force * prior.untouched_force);
    c.diagonal().tail<3>().setConstant(prior.untouched_moment * prior.untouched_moment);
  }
  using Row6 = Eigen::Matrix<double, 1, 6>;
  for (Index s = 0; s < suite.size(); ++s) {
    const BodySensor& sensor = suite.sensor(s);
    const Index row = suite.row(s);
    const auto i = static_cast<std::size_t>(sensor.link);
    const LinkMotion& link = motion.link(sensor.link);
    const Matrix3 axes = sensor.frame == SensorFrame::kLink
                             ? sensor.orientation
                             : Matrix3(link.axes.transpose() * sensor.orientation);
    const Vector3 w = link.axes.transpose() * link.turn;
    switch (sensor.kind) {
      case Kind::kAccelerometer:
      case Kind::kAngularAcceleration:
        for (Index k = 0; k < 3; ++k) {
          Row6 h = Row6::Zero();
          double known = 0.0;
          if (sensor.kind == Kind::kAngularAcceleration) {
            h.tail<3>() = axes.col(k).transpose();
          } else {
            h.head<3>() = axes.col(k).transpose();
            h.tail<3>() = -axes.col(k).transpose() * skew(sensor.position);
            known = axes.col(k).dot(w.cross(w.cross(sensor.position)));
          }
          add(at.acceleration(sensor.link), h, known, y[row + k], sensor.deviation[k]);
        }
        break;
      case Kind::kJointAcceleration:
        add(at.joint_acceleration(body.dof(sensor.link)), Eigen::Matrix<double, 1, 1>(1.0), 0.0,
            y[row], sensor.deviation[0]);
        break;
      case Kind::kJointTorque: {
        Row6 h = Row6::Zero();
        h.tail<3>() = body.link(sensor.link).axis.transpose();
        add(at.joint_wrench(sensor.link), h, 0.0, y[row], sensor.deviation[0]);
        break;
      }
      case Kind::kJointWrench:
        for (Index k = 0; k < 6; ++k) {
          add(at.joint_wrench(sensor.link), Row6(Row6::Unit(k)), 0.0, y[row + k],
              sensor.deviation[k]);
        }
        break;
      default:
        add_contact(sensor, prior, state, link, y, row, mean[i], covariance[i]);
        break;
    }
  }
  for (Index i = 0; i < at.links; ++i) {
    const auto r = static_cast<Index>(bias.size());
    put(entries, r, at.external(i), Matrix6(Matrix6::Identity()));
    put(weights, r, r, Matrix6(covariance[static_cast<std::size_t>(i)].inverse()));
    for (const double value : mean[static_cast<std::size_t>(i)]) {
      bias.push_back(0.0);
      measured.push_back(value);
    }
  }
  const auto rows = static_cast<Index>(bias.size());
  system.sensors = sparse(entries, rows, at.unknowns());
  system.sensors_weight = sparse(weights, rows, rows);
  system.sensors_bias = Eigen::Map<const Vector>(bias.data(), rows);
  system.measured = Eigen::Map<const Vector>(measured.data(), rows);

  system.prior_weight.setZero(at.unknowns());
  system.prior_mean.setZero(at.unknowns());
  system.prior_weight.head<3>().setConstant(1.0 /
                                            (prior.base_acceleration * prior.base_acceleration));
  system.prior_weight.segment<3>(3).setConstant(
      1.0 / (prior.base_angular_acceleration * prior.base_angular_acceleration));
  // Rest: gravity is felt upwards.
  system.prior_mean.head<3>() = motion.link(0).axes.transpose() * Vector3(0.0, 0.0, body.gravity());
  system.prior_weight.tail(at.dofs).setConstant(
      1.0 / (prior.joint_acceleration * prior.joint_acceleration));
  return system;
}

}  // namespace ulna
