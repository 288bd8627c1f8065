#include "estimate/torque_estimator.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

using Kind = BodySensorKind;

// Inertia of a link about the base origin, 6 x 6.
template <class M>
void add_inertia(const LinkMotion& link, M&& inertia) {
  const Matrix3 x = cross_matrix(link.mass * link.centre);
  inertia.template topLeftCorner<3, 3>().diagonal().array() += link.mass;
  inertia.template topRightCorner<3, 3>() -= x;
  inertia.template bottomLeftCorner<3, 3>() += x;
  inertia.template bottomRightCorner<3, 3>() += link.inertia - x * cross_matrix(link.centre);
}

// Lower Cholesky factor in place; false when the matrix is not positive definite.
template <class M>
bool factor(M& m, Index n) {
  for (Index j = 0; j < n; ++j) {
    double d = m(j, j);
    for (Index k = 0; k < j; ++k) d -= m(j, k) * m(j, k);
    if (!(d > 0.0)) return false;
    d = std::sqrt(d);
    m(j, j) = d;
    for (Index i = j + 1; i < n; ++i) {
      double s = m(i, j);
      for (Index k = 0; k < j; ++k) s -= m(i, k) * m(j, k);
      m(i, j) = s / d;
    }
  }
  return true;
}

// x := L^-1 x, column by column.
template <class L, class X>
void forward(const L& l, X&& x, Index n) {
  for (Index c = 0; c < x.cols(); ++c) {
    for (Index i = 0; i < n; ++i) {
      double s = x(i, c);
      for (Index k = 0; k < i; ++k) s -= l(i, k) * x(k, c);
      x(i, c) = s / l(i, i);
    }
  }
}

// x := L^-T x.
template <class L, class X>
void backward(const L& l, X&& x, Index n) {
  for (Index c = 0; c < x.cols(); ++c) {
    for (Index i = n; i-- > 0;) {
      double s = x(i, c);
      for (Index k = i + 1; k < n; ++k) s -= l(k, i) * x(k, c);
      x(i, c) = s / l(i, i);
    }
  }
}

// Rows of the balance's system: 6, or with joint sensors up to this, so that nothing is allocated.
constexpr int kMostRows = 64;
template <int kRows>
inline constexpr int kMost = kRows == 6 ? 6 : kMostRows;
template <int kRows>
using ColumnsOf = Eigen::Matrix<double, 6, kRows, Eigen::ColMajor, 6, kMost<kRows>>;
template <int kRows>
using ColumnOf = Eigen::Matrix<double, kRows, 1, Eigen::ColMajor, kMost<kRows>, 1>;
template <int kRows>
using RowOf = Eigen::Matrix<double, 1, kRows, Eigen::RowMajor, 1, kMost<kRows>>;
template <int kRows>
using SystemOf = Eigen::Matrix<double, kRows, kRows, Eigen::ColMajor, kMost<kRows>, kMost<kRows>>;
template <int kRows>
using HalfOf = Eigen::Matrix<double, kRows, 6, Eigen::ColMajor, kMost<kRows>, 6>;

// Deviations of a wrench's components (link axes, about the link's origin) from its covariance
// about the base origin.
template <class Column>
void write_deviations(const LinkMotion& link, const Matrix6& covariance, Column&& deviation) {
  for (Index k = 0; k < 3; ++k) {
    const Vector3 axis = link.axes.col(k);
    const double force = axis.dot(covariance.topLeftCorner<3, 3>() * axis);
    Vector6 d;
    d << link.origin.cross(axis), axis;
    deviation[k] = std::sqrt(std::max(0.0, force));
    deviation[3 + k] = std::sqrt(std::max(0.0, d.dot(covariance * d)));
  }
}

}  // namespace

struct TorqueEstimator::Node {
  Index parent = -1;
  Index dof = -1;
  bool massive = false;
  LinkEvidence* given = nullptr;  // its information becomes that of the link's subtree
  Vector6 u = Vector6::Zero();
  double pivot = 1.0, kappa = 0.0;
  Vector6 field = Vector6::Zero();  // estimate, without drift
  // Wrenches about the base origin.
  Matrix6 subtree = Matrix6::Zero();  // covariance of the subtree's sum
  Vector6 known = Vector6::Zero();    // of the subtree: drift and gyroscopic less external
  Vector6 wrench = Vector6::Zero();   // through the joint, estimate
  // Spread.
  Matrix6 covariance = Matrix6::Zero();  // of the field, before the balance
  Matrix6 noise = Matrix6::Zero();       // of the subtree's inertial wrench, the link's field given
};

TorqueEstimator::TorqueEstimator(std::shared_ptr<const SensorSuite> suite,
                                 const TorqueOptions& options)
    : suite_(std::move(suite)),
      options_(options),
      motion_(suite_->shared_body()),
      evidence_(suite_) {
  require(options.momentum_rate_force > 0.0 && std::isfinite(options.momentum_rate_force) &&
              options.momentum_rate_moment > 0.0 && std::isfinite(options.momentum_rate_moment),
          "options", "deviations of the rate of momentum must be positive and finite");
  const BodyTree& body = suite_->body();
  nodes_.resize(static_cast<std::size_t>(body.size()));
  for (Index i = 0; i < body.size(); ++i) {
    Node& node = nodes_[static_cast<std::size_t>(i)];
    node.parent = body.parent(i);
    node.dof = body.dof(i);
    node.massive = body.link(i).mass > 0.0;
    node.given = &evidence_.links[static_cast<std::size_t>(i)];
  }
  require(options.scheme == TorqueScheme::kOneShot || evidence_.joints.empty(), "options",
          "measured torques and wrenches of joints are for the one-shot estimate; the stack has "
          "no place for them");
  rows_ = 6 + static_cast<Index>(evidence_.joints.size());
  require(rows_ <= kMostRows, "sensors",
          "there are " + std::to_string(evidence_.joints.size()) +
              " rows of measured joint torques and wrenches; " + std::to_string(kMostRows - 6) +
              " are taken");
  has_field_sensor_.assign(nodes_.size(), 0);
  for (const BodySensor& sensor : suite_->sensors()) {
    if (sensor.kind == Kind::kAccelerometer || sensor.kind == Kind::kAngularAcceleration) {
      has_field_sensor_[static_cast<std::size_t>(sensor.link)] = 1;
    }
  }
  const Index n = body.size();
  columns_.setZero(6, rows_ * n);
  responses_.setZero(6, rows_ * n);
  sums_.setZero(6, rows_ * n);
  hinge_rows_.setZero(rows_, n);
  system_.setZero(rows_, rows_);
  missing_.setZero(rows_);
  pull_.setZero(rows_);
  frame_.torque.setZero(body.dofs());
  frame_.joint_acceleration.setZero(body.dofs());
  frame_.torque_deviation.setZero(body.dofs());
  frame_.joint_acceleration_deviation.setZero(body.dofs());
  frame_.external.setZero(6, n);
  frame_.joint_wrench.setZero(6, n);
  frame_.external_deviation.setZero(6, n);
  frame_.joint_wrench_deviation.setZero(6, n);
  frame_.innovation.setZero(suite_->rows());
  frame_.innovation_deviation.setZero(suite_->rows());
}

TorqueEstimator::~TorqueEstimator() = default;
TorqueEstimator::TorqueEstimator(TorqueEstimator&&) noexcept = default;
TorqueEstimator& TorqueEstimator::operator=(TorqueEstimator&&) noexcept = default;

// Leaves to base: each hinge's acceleration is eliminated from the information.
void TorqueEstimator::eliminate() {
  for (std::size_t i = nodes_.size(); i-- > 1;) {
    Node& node = nodes_[i];
    Node& parent = nodes_[static_cast<std::size_t>(node.parent)];
    if (node.dof < 0) {
      parent.given->info += node.given->info;
      parent.given->rhs += node.given->rhs;
      continue;
    }
    const Vector6& s = motion_.link(static_cast<Index>(i)).hinge;
    node.u.noalias() = node.given->info * s;
    node.pivot = s.dot(node.u) + node.given->weight;
    node.kappa = s.dot(node.given->rhs) + node.given->weighted;
    parent.given->info += node.given->info;
    parent.given->info.noalias() -= (node.u / node.pivot) * node.u.transpose();
    parent.given->rhs += node.given->rhs - node.u * (node.kappa / node.pivot);
  }
  root_ = nodes_[0].given->info;
  factor(root_, 6);  // positive definite by the prior
}

// Sums over subtrees: what is known of the wrench through each joint, and the covariance of the
// external wrenches beyond it.
void TorqueEstimator::collect_wrenches() {
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    Node& node = nodes_[i];
    const LinkMotion& link = motion_.link(static_cast<Index>(i));
    node.known = -node.given->external;
    if (node.massive) node.known += inertial_wrench(link, link.drift) + link.gyroscopic;
    node.subtree = node.given->spread;
  }
  for (std::size_t i = nodes_.size(); i-- > 1;) {
    Node& parent = nodes_[static_cast<std::size_t>(nodes_[i].parent)];
    parent.known += nodes_[i].known;
    parent.subtree += nodes_[i].subtree;
  }
}

// The system of the balance: what the wrenches through the base (and through measured joints) lack,
// and its covariance, from accelerations and external wrenches.
template <int kRows>
void TorqueEstimator::balance() {
  using Columns = ColumnsOf<kRows>;
  using Row = RowOf<kRows>;
  const Index m = rows_;
  const auto columns = [&](std::size_t i) {
    return Eigen::Map<Columns>(columns_.data() + 6 * m * static_cast<Index>(i), 6, m);
  };
  // Response of the wrench through each link to its field, the hinges beyond it free to follow
  // their own information: transposed, one column a row of the system.
  columns_.setZero();
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (nodes_[i].massive) {
      add_inertia(motion_.link(static_cast<Index>(i)), columns(i).template leftCols<6>());
    }
  }
  for (std::size_t i = nodes_.size(); i-- > 1;) {
    const Node& node = nodes_[i];
    auto h = columns(i);
    if constexpr (kRows != 6) {
      for (std::size_t l = 0; l < evidence_.joints.size(); ++l) {
        if (evidence_.joints[l].link != static_cast<Index>(i)) continue;
        h.col(6 + static_cast<Index>(l)) = h.template leftCols<6>() * evidence_.joints[l].direction;
      }
    }
    auto parent = columns(static_cast<std::size_t>(node.parent));
    parent += h;
    if (node.dof < 0) continue;
    const Row g = motion_.link(static_cast<Index>(i)).hinge.transpose() * h;
    parent.noalias() -= (node.u / node.pivot) * g;
    hinge_rows_.col(static_cast<Index>(i)) = g.transpose();
  }
  if constexpr (kRows != 6) {
    // Within the subtree of a measured joint its row is a combination of the first six.
    for (std::size_t l = 0; l < evidence_.joints.size(); ++l) {
      for (Index i = evidence_.joints[l].link + 1; i < static_cast<Index>(nodes_.size()); ++i) {
        if (!motion_.body().carries(evidence_.joints[l].link, i)) continue;
        hinge_rows_(6 + static_cast<Index>(l), i) =
            hinge_rows_.col(i).template head<6>().dot(evidence_.joints[l].direction);
      }
    }
  }

  Eigen::Map<SystemOf<kRows>> system(system_.data(), m, m);
  Eigen::Map<ColumnOf<kRows>> missing(missing_.data(), m);
  Vector6 base = nodes_[0].given->rhs;
  forward(root_, base, 6);
  frame_.motion_nis -= base.squaredNorm();
  {
    Columns first = columns(0);
    forward(root_, first, 6);
    system.noalias() = first.transpose() * first;
    missing.noalias() = first.transpose() * base;
  }
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    if (node.dof < 0) continue;
    const Eigen::Map<const ColumnOf<kRows>> g(hinge_rows_.data() + m * static_cast<Index>(i), m);
    system.noalias() += (g / node.pivot) * g.transpose();
    missing += g * (node.kappa / node.pivot);
    frame_.motion_nis -= node.kappa * node.kappa / node.pivot;
  }
  if constexpr (kRows == 6) {
    if (options_.scheme == TorqueScheme::kStack) {
      first_task();
      missing += nodes_[0].known;
      system += nodes_[0].subtree;
      factor(system, 6);
      pull_ = missing_;
      forward(system, pull_, 6);
      backward(system, pull_, 6);
      return;
    }
  }
  system.template topLeftCorner<6, 6>() += nodes_[0].subtree;
  missing.template head<6>() += nodes_[0].known;
  frame_.balance_rows = 6;
  for (std::size_t l = 0; l < evidence_.joints.size(); ++l) {
    const JointEvidence& extra = evidence_.joints[l];
    const Node& node = nodes_[static_cast<std::size_t>(extra.link)];
    const Index at = 6 + static_cast<Index>(l);
    frame_.balance_rows += extra.direction.isZero(0.0) ? 0 : 1;
    missing[at] += extra.direction.dot(node.known) - extra.value;
    const Vector6 shared = node.subtree * extra.direction;
    system.row(at).template head<6>() += shared;
    system.col(at).template head<6>() += shared;
    system(at, at) += extra.variance;
    for (std::size_t k = 0; k < evidence_.joints.size(); ++k) {
      const JointEvidence& other = evidence_.joints[k];
      const Index deeper = motion_.body().carries(extra.link, other.link)   ? other.link
                           : motion_.body().carries(other.link, extra.link) ? extra.link
                                                                            : -1;
      if (deeper < 0) continue;
      system(at, 6 + static_cast<Index>(k)) +=
          extra.direction.dot(nodes_[static_cast<std::size_t>(deeper)].subtree * other.direction);
    }
  }
  frame_.residual = missing.template head<6>();
  frame_.residual_covariance = system.template topLeftCorner<6, 6>();
  factor(system, m);  // positive definite: every link's wrench has a covariance
  pull_ = missing_;
  forward(system, pull_, m);
  frame_.balance_nis = pull_.squaredNorm();
  for (Index k = 0; k < m; ++k) frame_.log_likelihood -= std::log(system(k, k));
  frame_.log_likelihood -=
      0.5 * (frame_.balance_nis + static_cast<double>(frame_.balance_rows) * kLogTwoPi);
  backward(system, pull_, m);
}

// Task 1 of the stack: external wrenches from the rate of the momentum. Afterwards they are as
// measured, each with its own covariance (what they share is left out, as published).
void TorqueEstimator::first_task() {
  Matrix6 system = nodes_[0].subtree;
  system.diagonal().head<3>().array() +=
      options_.momentum_rate_force * options_.momentum_rate_force;
  system.diagonal().tail<3>().array() +=
      options_.momentum_rate_moment * options_.momentum_rate_moment;
  Vector6 missing = missing_;
  missing += nodes_[0].known;
  frame_.residual = missing;
  frame_.residual_covariance = system;
  frame_.balance_rows = 6;
  factor(system, 6);
  first_ = system;
  forward(system, missing, 6);
  frame_.balance_nis = missing.squaredNorm();
  frame_.log_likelihood -= 0.5 * (frame_.balance_nis + 6.0 * kLogTwoPi);
  for (Index k = 0; k < 6; ++k) frame_.log_likelihood -= std::log(system(k, k));
  backward(system, missing, 6);
  first_pull_ = missing;
  for (Node& node : nodes_) {
    node.given->external.noalias() += node.given->spread * missing;
    Matrix6 half = node.given->spread;
    forward(system, half, 6);
    node.given->spread.noalias() -= half.transpose() * half;
  }
  collect_wrenches();
}

Vector6 TorqueEstimator::pull(Index link) const {
  Vector6 all = pull_.head<6>();
  for (std::size_t l = 0; l < evidence_.joints.size(); ++l) {
    if (motion_.body().carries(evidence_.joints[l].link, link)) {
      all += evidence_.joints[l].direction * pull_[6 + static_cast<Index>(l)];
    }
  }
  return all;
}

// Base to leaves: accelerations; leaves to base: wrenches.
void TorqueEstimator::resolve() {
  const Index m = rows_;
  Vector6 base = nodes_[0].given->rhs;
  base.noalias() -= columns_.leftCols(m) * pull_;
  forward(root_, base, 6);
  backward(root_, base, 6);
  nodes_[0].field = base;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    Node& node = nodes_[i];
    const LinkMotion& link = motion_.link(static_cast<Index>(i));
    if (i > 0) {
      node.field = nodes_[static_cast<std::size_t>(node.parent)].field;
      if (node.dof >= 0) {
        const double acceleration =
            (node.kappa - hinge_rows_.col(static_cast<Index>(i)).dot(pull_) -
             node.u.dot(node.field)) /
            node.pivot;
        node.field += link.hinge * acceleration;
        frame_.joint_acceleration[node.dof] = acceleration;
      }
    }
    node.given->external.noalias() += node.given->spread * pull(static_cast<Index>(i));
    node.wrench = -node.given->external;
    if (node.massive) {
      node.wrench += inertial_wrench(link, node.field + link.drift) + link.gyroscopic;
    }
  }
  for (std::size_t i = nodes_.size(); i-- > 1;) {
    nodes_[static_cast<std::size_t>(nodes_[i].parent)].wrench += nodes_[i].wrench;
  }
}

void TorqueEstimator::write_result() {
  frame_.base_acceleration = nodes_[0].field;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    const LinkMotion& link = motion_.link(static_cast<Index>(i));
    const auto told = [&](const Vector6& wrench, auto&& column) {
      const Vector3 force = wrench.head<3>();
      column.template head<3>() = link.axes.transpose() * force;
      column.template tail<3>() =
          link.axes.transpose() * (wrench.tail<3>() - link.origin.cross(force));
    };
    told(node.given->external, frame_.external.col(static_cast<Index>(i)));
    told(node.wrench, frame_.joint_wrench.col(static_cast<Index>(i)));
    if (node.dof >= 0) frame_.torque[node.dof] = link.hinge.dot(node.wrench);
  }
}

// log p of the motion's rows: the determinants; the weights have been counted on the way.
void TorqueEstimator::write_likelihood() {
  const BodyPrior& prior = suite_->prior();
  const auto dofs = static_cast<double>(motion_.body().dofs());
  double half_log = 0.0;
  for (Index k = 0; k < 6; ++k) half_log += std::log(root_(k, k));
  for (const Node& node : nodes_) {
    if (node.dof >= 0) half_log += 0.5 * std::log(node.pivot);
  }
  half_log += 3.0 * std::log(prior.base_acceleration * prior.base_angular_acceleration) +
              dofs * std::log(prior.joint_acceleration);
  frame_.log_likelihood -= half_log + 0.5 * frame_.motion_nis;
}

void TorqueEstimator::innovations_of_motion(const VectorRef& y, Index link_index) {
  const Node& node = nodes_[static_cast<std::size_t>(link_index)];
  const LinkMotion& link = motion_.link(link_index);
  // Covariance of the field after the balance.
  Matrix6 covariance = node.covariance;
  HalfOf<Eigen::Dynamic> half = responses_.middleCols(rows_ * link_index, rows_).transpose();
  forward(system_, half, rows_);
  covariance.noalias() -= half.transpose() * half;
  const Vector6 field = node.field + link.drift;
  for (Index s = 0; s < suite_->size(); ++s) {
    const BodySensor& sensor = suite_->sensor(s);
    if (sensor.link != link_index) continue;
    const bool turning = sensor.kind == Kind::kAngularAcceleration;
    if (!turning && sensor.kind != Kind::kAccelerometer) continue;
    const PlacedSensor placed = placed_sensor(sensor, link, Vector3::Zero());
    for (Index k = 0; k < 3; ++k) {
      const Index row = suite_->row(s) + k;
      const Vector3 axis = placed.axes.col(k);
      Vector6 h = Vector6::Zero();
      if (turning) {
        h.tail<3>() = axis;
      } else {
        h.head<3>() = axis;
        h.tail<3>() = placed.at.cross(axis);
      }
      double estimate = h.dot(field);
      if (!turning) {
        estimate += axis.dot(link.turn.cross(link.turn.cross(placed.at - link.origin)));
      }
      const double variance = sensor.deviation[k] * sensor.deviation[k];
      frame_.innovation[row] = std::isfinite(y[row]) ? y[row] - estimate : kNaN;
      frame_.innovation_deviation[row] = std::sqrt(std::max(0.0, variance - h.dot(covariance * h)));
    }
  }
}

// Standard deviations: covariances of the fields from base to leaves, of the wrenches from leaves
// to base, less what the balance has told.
template <int kRows>
void TorqueEstimator::spread(const VectorRef& y) {
  using Columns = ColumnsOf<kRows>;
  using Row = RowOf<kRows>;
  const Index m = rows_;
  const auto columns = [&](Matrix& of, std::size_t i) {
    return Eigen::Map<Columns>(of.data() + 6 * m * static_cast<Index>(i), 6, m);
  };
  const Eigen::Map<const SystemOf<kRows>> system(system_.data(), m, m);
  const auto count = nodes_.size();
  const BodyPrior& prior = suite_->prior();

  // Base to leaves: covariance of the field, and with the rows of the balance.
  nodes_[0].covariance.setIdentity();
  forward(root_, nodes_[0].covariance, 6);
  nodes_[0].covariance = (nodes_[0].covariance.transpose() * nodes_[0].covariance).eval();
  columns(responses_, 0).noalias() = nodes_[0].covariance * columns(columns_, 0);
  const Vector6 base = nodes_[0].covariance.diagonal();
  frame_.motion_freedom =
      static_cast<double>(frame_.motion_rows) - 6.0 - static_cast<double>(motion_.body().dofs()) +
      base.head<3>().sum() / (prior.base_acceleration * prior.base_acceleration) +
      base.tail<3>().sum() / (prior.base_angular_acceleration * prior.base_angular_acceleration);
  for (std::size_t i = 1; i < count; ++i) {
    Node& node = nodes_[i];
    const auto p = static_cast<std::size_t>(node.parent);
    const Matrix6& before = nodes_[p].covariance;
    if (node.dof < 0) {
      node.covariance = before;
      columns(responses_, i) = columns(responses_, p);
      continue;
    }
    const Vector6& s = motion_.link(static_cast<Index>(i)).hinge;
    const Vector6 v = before * node.u / node.pivot;
    const double own = (node.u.dot(v) + 1.0) / node.pivot;  // variance of the hinge
    const Row g = hinge_rows_.col(static_cast<Index>(i)).transpose();
    const Row with = (g - node.u.transpose() * columns(responses_, p)) / node.pivot;
    node.covariance = before - s * v.transpose() - v * s.transpose() + own * s * s.transpose();
    columns(responses_, i) = columns(responses_, p) + s * with;
    frame_.motion_freedom += own / (prior.joint_acceleration * prior.joint_acceleration);
    ColumnOf<kRows> half = with.transpose();
    forward(system, half, m);
    frame_.joint_acceleration_deviation[node.dof] =
        std::sqrt(std::max(0.0, own - half.squaredNorm()));
  }

  // Leaves to base: covariance of the wrench through each joint.
  for (std::size_t i = 0; i < count; ++i) {
    nodes_[i].noise.setZero();
    auto sum = columns(sums_, i);
    if (!nodes_[i].massive) {
      sum.setZero();
      continue;
    }
    const LinkMotion& link = motion_.link(static_cast<Index>(i));
    const auto response = columns(responses_, i);
    for (Index c = 0; c < m; ++c) sum.col(c) = inertial_wrench(link, response.col(c));
  }
  for (std::size_t i = count; i-- > 1;) {
    const auto p = static_cast<std::size_t>(nodes_[i].parent);
    columns(sums_, p) += columns(sums_, i);
    nodes_[p].noise += nodes_[i].noise;
    if (nodes_[i].dof < 0) continue;
    const auto g = hinge_rows_.col(static_cast<Index>(i)).template head<6>();
    nodes_[p].noise.noalias() += (g / nodes_[i].pivot) * g.transpose();
  }
  frame_.joint_wrench_deviation.col(0).setZero();
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = static_cast<Index>(i);
    const LinkMotion& link = motion_.link(at);
    Node& node = nodes_[i];
    // External wrench of the link: its covariance with the rows is minus this.
    Columns outer(6, m);
    outer.template leftCols<6>() = node.given->spread;
    for (Index l = 6; l < m; ++l) {
      const JointEvidence& extra = evidence_.joints[static_cast<std::size_t>(l - 6)];
      outer.col(l).setZero();
      if (motion_.body().carries(extra.link, at))
        outer.col(l) = node.given->spread * extra.direction;
    }
    HalfOf<kRows> half = outer.transpose();
    forward(system, half, m);
    Matrix6 covariance = node.given->spread;
    covariance.noalias() -= half.transpose() * half;
    write_deviations(link, covariance, frame_.external_deviation.col(at));
    if (i == 0) continue;
    auto with = columns(sums_, i);
    with.template leftCols<6>() += node.subtree;
    for (Index l = 6; l < m; ++l) {
      const JointEvidence& extra = evidence_.joints[static_cast<std::size_t>(l - 6)];
      if (motion_.body().carries(extra.link, at)) {
        with.col(l) += node.subtree * extra.direction;
      } else if (motion_.body().carries(at, extra.link)) {
        with.col(l) += nodes_[static_cast<std::size_t>(extra.link)].subtree * extra.direction;
      }
    }
    const auto h = columns(columns_, i).template leftCols<6>();
    covariance = node.noise + node.subtree;
    const Matrix6 field = node.covariance * h;
    covariance.noalias() += h.transpose() * field;
    half = with.transpose();
    forward(system, half, m);
    covariance.noalias() -= half.transpose() * half;
    write_deviations(link, covariance, frame_.joint_wrench_deviation.col(at));
    if (node.dof < 0) continue;
    frame_.torque_deviation[node.dof] =
        std::sqrt(std::max(0.0, link.hinge.dot(covariance * link.hinge)));
  }
  write_innovations(y);
}

void TorqueEstimator::write_innovations(const VectorRef& y) {
  for (Index i = 0; i < static_cast<Index>(nodes_.size()); ++i) {
    if (has_field_sensor_[static_cast<std::size_t>(i)] != 0) innovations_of_motion(y, i);
  }
  const auto set = [&](Index row, double estimate, double variance) {
    frame_.innovation[row] = std::isfinite(y[row]) ? y[row] - estimate : kNaN;
    frame_.innovation_deviation[row] = std::sqrt(std::max(0.0, variance));
  };
  for (Index s = 0; s < suite_->size(); ++s) {
    const BodySensor& sensor = suite_->sensor(s);
    if (sensor.kind != Kind::kJointAcceleration) continue;
    const Index k = nodes_[static_cast<std::size_t>(sensor.link)].dof;
    const double spread = frame_.joint_acceleration_deviation[k];
    set(suite_->row(s), frame_.joint_acceleration[k],
        sensor.deviation[0] * sensor.deviation[0] - spread * spread);
  }
  // Contacts by the task that moved them.
  const bool stack = options_.scheme == TorqueScheme::kStack;
  for (const ContactEvidence& contact : evidence_.contacts) {
    if (sensor_rows(suite_->sensor(contact.sensor).kind) == 0) continue;
    const Vector6 asked = contact.frame.transpose() * (stack ? first_pull_ : pull(contact.link));
    for (Index k = 0; k < contact.components; ++k) {
      const Vector6 direction = contact.frame.col(k);
      double told = 0.0;  // of the component by the rows, over its variance
      if (stack) {
        Vector6 half = direction;
        forward(first_, half, 6);
        told = half.squaredNorm();
      } else {
        ColumnOf<Eigen::Dynamic> half(rows_);
        half.head<6>() = direction;
        for (Index l = 6; l < rows_; ++l) {
          const JointEvidence& extra = evidence_.joints[static_cast<std::size_t>(l - 6)];
          half[l] = motion_.body().carries(extra.link, contact.link)
                        ? extra.direction.dot(direction)
                        : 0.0;
        }
        forward(system_, half, rows_);
        told = half.squaredNorm();
      }
      const double variance = contact.variance[k];
      set(suite_->row(contact.sensor) + k, contact.mean[k] + variance * asked[k],
          variance * variance * told);
    }
  }
  for (std::size_t l = 0; l < evidence_.joints.size(); ++l) {
    const JointEvidence& extra = evidence_.joints[l];
    ColumnOf<Eigen::Dynamic> half(rows_);
    half.setZero();
    half[6 + static_cast<Index>(l)] = extra.variance;
    forward(system_, half, rows_);
    set(extra.row, extra.direction.dot(nodes_[static_cast<std::size_t>(extra.link)].wrench),
        half.squaredNorm());
  }
}

void TorqueEstimator::write_missing() noexcept {
  frame_.usable = false;
  for (Vector* v :
       {&frame_.torque, &frame_.joint_acceleration, &frame_.torque_deviation,
        &frame_.joint_acceleration_deviation, &frame_.innovation, &frame_.innovation_deviation}) {
    v->setConstant(kNaN);
  }
  for (Matrix* m : {&frame_.external, &frame_.joint_wrench, &frame_.external_deviation,
                    &frame_.joint_wrench_deviation}) {
    m->setConstant(kNaN);
  }
  frame_.base_acceleration.setConstant(kNaN);
  frame_.residual.setConstant(kNaN);
  frame_.residual_covariance.setConstant(kNaN);
  frame_.balance_nis = frame_.motion_nis = frame_.motion_freedom = frame_.log_likelihood = kNaN;
  frame_.balance_rows = frame_.motion_rows = 0;
}

const TorqueFrame& TorqueEstimator::update(const BodyState& state, const VectorRef& y,
                                           bool deviations) noexcept {
  if (!state.angle.allFinite() || !state.rate.allFinite() || !state.orientation.allFinite() ||
      !state.position.allFinite() || !state.angular_velocity.allFinite()) {
    write_missing();
    return frame_;
  }
  frame_.usable = true;
  motion_.move(state);
  evidence_.gather(motion_, state, y);
  frame_.motion_rows = evidence_.motion_rows;
  frame_.motion_nis = evidence_.motion_squares;
  frame_.log_likelihood = evidence_.log_weights;
  eliminate();
  collect_wrenches();
  if (rows_ == 6) {
    balance<6>();
  } else {
    balance<Eigen::Dynamic>();
  }
  resolve();
  write_result();
  write_likelihood();
  if (!deviations) return frame_;
  if (rows_ == 6) {
    spread<6>(y);
  } else {
    spread<Eigen::Dynamic>(y);
  }
  return frame_;
}

}  // namespace ulna
