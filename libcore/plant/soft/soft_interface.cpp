#include "plant/soft/soft_interface.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

constexpr double kReach = 0.003;  // contacts this far apart can meet within a step, m

using Jacobian = Eigen::Matrix<double, 3, 6>;

// Velocity of a point of the limb at `arm` from the tissue's centre.
Jacobian velocity_at(const Vector3& arm) {
  Jacobian jacobian;
  jacobian << Matrix3::Identity(), Matrix3::Zero();
  jacobian(0, 4) = arm.z(), jacobian(0, 5) = -arm.y();
  jacobian(1, 3) = -arm.z(), jacobian(1, 5) = arm.x();
  jacobian(2, 3) = arm.y(), jacobian(2, 4) = -arm.x();
  return jacobian;
}

// Coulomb friction as a damper that has its force at the present speed.
double friction_damping(double normal_force, const Vector3& slip, const SoftInterfaceOptions& o) {
  return o.friction * normal_force / std::max(slip.norm(), o.creep_speed);
}

const SoftInterfaceOptions& checked_interface(const SoftInterfaceOptions& options) {
  options.check();
  return options;
}

}  // namespace

SoftInterfaceOptions SoftInterfaceOptions::upper_arm(double upper_scale) {
  return {.name = "upper",
          .cuff = Cuff::upper_arm(),
          .strap = {},
          .tissue = TissueOptions::upper_arm(),
          .bone = "humerus",
          .centre = upper_scale * Vector3(0.14, 0.0, 0.0)};
}

SoftInterfaceOptions SoftInterfaceOptions::forearm(double fore_scale) {
  return {.name = "fore",
          .cuff = Cuff::forearm(),
          .strap = {},
          .tissue = TissueOptions::forearm(),
          .bone = "ulna",
          .centre = fore_scale * Vector3(0.12, -0.01, 0.015)};
}

void SoftInterfaceOptions::check() const {
  cuff.check();
  strap.check();
  tissue.check();
  require(!bone.empty() && centre.allFinite(), "bone",
          "the tissue '" + name + "' must be at a finite place of a bone");
  require(std::isfinite(friction) && friction >= 0.0 && friction <= 10.0, "friction",
          "the friction of '" + name + "' must be between 0 and 10");
  require(std::isfinite(creep_speed) && creep_speed > 0.0, "creep_speed",
          "the creep speed of '" + name + "' must be positive");
  require(std::isfinite(pad_stiffness) && pad_stiffness > 0.0, "pad_stiffness",
          "the pads of '" + name + "' must have a positive stiffness");
}

SoftInterface::SoftInterface(const SoftInterfaceOptions& options)
    : options_(checked_interface(options)), tissue_(options.tissue), strap_(options.strap) {}

InterfaceRun::InterfaceRun(std::shared_ptr<const SoftInterface> model,
                           std::shared_ptr<const TissueStep> step)
    : model_(std::move(model)), step_(std::move(step)) {}

void InterfaceRun::don(const LimbPose& pose) {
  const Tissue& tissue = model_->tissue();
  const Strap& strap = model_->strap();
  donned_pose_ = pose;
  displacement_ = rate_ = cuff_force_ = Vector::Zero(tissue.size());
  point_rate_ = Vector::Zero(3 * strap.moving());
  strap_force_ = Vector::Zero(strap.moving());
  twist_.setZero();
  sliding_.setZero();
  near_.assign(static_cast<std::size_t>(strap.moving()), 0);
  covered_.clear();
  for (int i = 0; i < tissue.size(); ++i) {
    const Vector3 at = pose.position + pose.orientation * tissue.mesh().point(i);
    if (std::fabs(at.z()) <= 0.5 * model_->options().cuff.depth) covered_.push_back(i);
  }
  const Vector3 square = tissue.mesh().semi_axes().cwiseAbs2();
  faces_ = model_->options().cuff.faces(
      pose.position, pose.orientation * square.asDiagonal() * pose.orientation.transpose());
  int plate = 0;
  const Vector3 middle(pose.position.x(), pose.position.y(), 0.0);
  const Cuff& cuff = model_->options().cuff;
  Cuff::Faces steel;
  steel.fill(cuff.face());
  const double over = cuff.penetration(steel, middle, plate);
  if (over > -0.4 * tissue.mesh().semi_axes().minCoeff() || pose.position.y() > cuff.face()) {
    throw Error(Fault::kArgument, "start",
                "the limb does not lie in the cuff on '" + cuff.link + "': its axis is " +
                    std::to_string(std::lround(-1e3 * over)) + " mm inside the plates");
  }
  const Vector3 weight = tissue.mesh().semi_axes().cwiseAbs2().cwiseInverse();
  const Matrix3 ellipsoid = pose.orientation * weight.asDiagonal() * pose.orientation.transpose();
  Strap::Donned donned = strap.don(pose.position, ellipsoid);
  points_ = std::move(donned.points);
  rest_ = std::move(donned.rest);
  cuff_report_ = strap_report_ = {};
}

InterfaceRun::CuffTouch InterfaceRun::cuff_touch(const LimbPose& pose, int i) const {
  const TissueMesh& mesh = model_->tissue().mesh();
  const Vector3 radial = pose.orientation * mesh.direction(i);
  CuffTouch touch{.element = i, .plate = 0, .depth = 0.0, .normal = {}, .arm = {}, .slope = 0.0};
  touch.arm = (mesh.radius(i) + displacement_[i]) * radial;
  touch.depth = model_->options().cuff.penetration(faces_, pose.position + touch.arm, touch.plate);
  touch.normal = model_->options().cuff.outward(touch.plate);
  touch.slope = touch.normal.dot(radial);
  return touch;
}

InterfaceRun::StrapTouch InterfaceRun::strap_touch(const LimbPose& pose, int k) const {
  StrapTouch touch{.point = k, .depth = 0.0, .place = {}, .normal = {}, .arm = {}};
  touch.arm = points_.col(k) - pose.position;
  const Vector3 at = pose.orientation.transpose() * touch.arm;
  touch.place = model_->tissue().mesh().place(at, near_[static_cast<std::size_t>(k)]);
  Vector3 bulge;
  for (int a = 0; a < 3; ++a) {
    bulge[a] = displacement_[touch.place.corner[static_cast<std::size_t>(a)]];
  }
  touch.depth = touch.place.radius + touch.place.share.dot(bulge) +
                0.5 * model_->options().strap.thickness - at.norm();
  touch.normal = pose.orientation * (touch.place.slope - touch.place.gradient.transpose() * bulge);
  return touch;
}

Twist InterfaceRun::row_of(const CuffTouch& t) const {
  Twist row;
  row << t.normal, t.arm.cross(t.normal);
  return row;
}

Twist InterfaceRun::row_of(const StrapTouch& t) const {
  Twist row;
  row << t.normal, t.arm.cross(t.normal);
  return row;
}

void InterfaceRun::find_touches(const LimbPose& pose) {
  cuff_touches_.clear();
  strap_touches_.clear();
  for (const int i : covered_) {
    CuffTouch touch = cuff_touch(pose, i);
    if (touch.depth > -kReach && touch.slope > 0.0) cuff_touches_.push_back(touch);
  }
  for (int k = 0; k < model_->strap().moving(); ++k) {
    strap_touches_.push_back(strap_touch(pose, k));
  }
}

// Friction as dampers: of the cuff between bone and link, of the strap between its points and the
// bone. Leaves the strap's free motion and how its points follow the limb and contact forces.
void InterfaceRun::add_friction() {
  const SoftInterfaceOptions& o = model_->options();
  const Strap& strap = model_->strap();
  const double dt = step_->timestep();
  friction_bias_.setZero();
  friction_resistance_.setZero();
  for (const CuffTouch& t : cuff_touches_) {
    const double normal_force = cuff_force_[t.element];
    if (normal_force <= 0.0) continue;
    const Matrix3 tangent = Matrix3::Identity() - t.normal * t.normal.transpose();
    const Jacobian slide = tangent * velocity_at(t.arm);
    friction_resistance_ +=
        friction_damping(normal_force, slide * twist_, o) * slide.transpose() * slide;
  }
  const Strap::Webbing web = strap.webbing(points_, rest_);
  tension_ = web.tension;
  Matrix system = web.damping + dt * web.stiffness;
  system.diagonal().array() += strap.point_mass() / dt;
  const Index n = 3 * strap.moving();
  const auto contacts = static_cast<Index>(strap_touches_.size());
  Matrix right = Matrix::Zero(n, contacts + 7);
  right.col(contacts + 6) = strap.point_mass() / dt * point_rate_ + web.force;
  for (Index k = 0; k < contacts; ++k) {
    const StrapTouch& t = strap_touches_[static_cast<std::size_t>(k)];
    right.block<3, 1>(3 * k, k) = t.normal;
    const double normal_force = strap_force_[t.point] * t.normal.norm();
    if (normal_force <= 0.0) continue;
    const Vector3 unit = t.normal.normalized();
    const Matrix3 tangent = Matrix3::Identity() - unit * unit.transpose();
    const Jacobian carry = tangent * velocity_at(t.arm);
    const Vector3 slip = tangent * point_rate_.segment<3>(3 * k) - carry * twist_;
    const double damping = friction_damping(normal_force, slip, o);
    system.block<3, 3>(3 * k, 3 * k) += damping * tangent;
    right.block<3, 6>(3 * k, contacts) = damping * carry;
    friction_resistance_ += damping * carry.transpose() * carry;
  }
  const Matrix pull = right.middleCols(contacts, 6);
  system.llt().solveInPlace(right);
  point_response_ = right.leftCols(contacts);
  point_follow_ = right.middleCols(contacts, 6);
  free_point_rate_ = right.col(contacts + 6);
  friction_bias_ = pull.transpose() * free_point_rate_;
  friction_resistance_ -= pull.transpose() * point_follow_;
}

void InterfaceRun::write_problem() {
  const SoftInterfaceOptions& o = model_->options();
  const TissueMesh& mesh = model_->tissue().mesh();
  const double dt = step_->timestep();
  const auto cuffs = static_cast<Index>(cuff_touches_.size());
  const auto straps = static_cast<Index>(strap_touches_.size());
  const Index n = cuffs + straps;
  ContactProblem problem{.timestep = dt,
                         .stiffness = Vector(n),
                         .penetration = Vector(n),
                         .approach = Matrix(n, 6),
                         .mobility = Matrix(n, n)};
  std::vector<char> active(static_cast<std::size_t>(n));
  tissue_response_.resize(mesh.size(), n);
  for (Index k = 0; k < cuffs; ++k) {
    const CuffTouch& t = cuff_touches_[static_cast<std::size_t>(k)];
    tissue_response_.col(k) = t.slope * step_->compliance().col(t.element);
    problem.stiffness[k] = o.pad_stiffness * mesh.area(t.element);
    problem.penetration[k] = t.depth + dt * t.slope * free_rate_[t.element];
    problem.approach.row(k) = row_of(t);
    active[static_cast<std::size_t>(k)] = t.depth > 0.0 ? 1 : 0;
  }
  for (Index k = 0; k < straps; ++k) {
    const StrapTouch& t = strap_touches_[static_cast<std::size_t>(k)];
    const Index c = cuffs + k;
    tissue_response_.col(c).setZero();
    double bulging = 0.0;
    for (int a = 0; a < 3; ++a) {
      const int i = t.place.corner[static_cast<std::size_t>(a)];
      tissue_response_.col(c) += t.place.share[a] * step_->compliance().col(i);
      bulging += t.place.share[a] * free_rate_[i];
    }
    problem.stiffness[c] = o.pad_stiffness * model_->strap().area();
    problem.penetration[c] =
        t.depth + dt * (bulging - t.normal.dot(free_point_rate_.segment<3>(3 * t.point)));
    problem.approach.row(c) = row_of(t);
    problem.approach.row(c) -= t.normal.transpose() * point_follow_.middleRows<3>(3 * t.point);
    active[static_cast<std::size_t>(c)] = t.depth > 0.0 ? 1 : 0;
  }
  for (Index k = 0; k < cuffs; ++k) {
    const CuffTouch& t = cuff_touches_[static_cast<std::size_t>(k)];
    problem.mobility.row(k) = t.slope * tissue_response_.row(t.element);
  }
  for (Index k = 0; k < straps; ++k) {
    const StrapTouch& t = strap_touches_[static_cast<std::size_t>(k)];
    auto row = problem.mobility.row(cuffs + k);
    row.setZero();
    for (int a = 0; a < 3; ++a) {
      row += t.place.share[a] * tissue_response_.row(t.place.corner[static_cast<std::size_t>(a)]);
    }
    row.tail(straps) += t.normal.transpose() * point_response_.middleRows<3>(3 * t.point);
  }
  law_.emplace(std::move(problem), std::move(active));
}

void InterfaceRun::begin(const LimbPose& pose) {
  free_rate_ = step_->free_rate(displacement_, rate_);
  find_touches(pose);
  add_friction();
  write_problem();
}

void InterfaceRun::condense(Wrench& bias, Matrix6& resistance) const {
  Vector b = friction_bias_;
  Matrix r = friction_resistance_;
  law_->condense(b, r);
  bias = b;
  resistance = r;
}

bool InterfaceRun::settle(const Twist& twist) { return law_->settle(twist); }

void InterfaceRun::finish(const Twist& twist) {
  const TissueMesh& mesh = model_->tissue().mesh();
  const Strap& strap = model_->strap();
  const double dt = step_->timestep();
  Wrench bias;
  Matrix6 resistance;
  condense(bias, resistance);
  wrench_ = bias - resistance * twist;
  const Vector& force = law_->force();
  const auto cuffs = static_cast<Index>(cuff_touches_.size());
  cuff_report_ = strap_report_ = {};
  const SoftInterfaceOptions& o = model_->options();
  for (const CuffTouch& t : cuff_touches_) {
    const double before = cuff_force_[t.element];
    if (before <= 0.0) continue;
    const Matrix3 tangent = Matrix3::Identity() - t.normal * t.normal.transpose();
    const Jacobian slide = tangent * velocity_at(t.arm);
    cuff_report_.wrench -=
        friction_damping(before, slide * twist_, o) * slide.transpose() * (slide * twist);
  }
  Vector3 slid = Vector3::Zero();
  cuff_force_.setZero();
  strap_force_.setZero();
  const auto count = [](ContactReport& report, double newtons, double area) {
    report.normal_force += newtons;
    report.area += newtons > 0.0 ? area : 0.0;
    report.peak_pressure = std::max(report.peak_pressure, newtons / area);
  };
  for (Index k = 0; k < cuffs; ++k) {
    const CuffTouch& t = cuff_touches_[static_cast<std::size_t>(k)];
    cuff_force_[t.element] = force[k];
    cuff_report_.wrench -= force[k] * row_of(t);
    const Vector3 velocity = velocity_at(t.arm) * twist;
    slid += force[k] * (velocity - velocity.dot(t.normal) * t.normal);
    count(cuff_report_, force[k], mesh.area(t.element));
  }
  for (std::size_t k = 0; k < strap_touches_.size(); ++k) {
    const StrapTouch& t = strap_touches_[k];
    const double newtons = force[cuffs + static_cast<Index>(k)];
    strap_force_[t.point] = newtons;
    count(strap_report_, newtons * t.normal.norm(), strap.area());
  }
  if (cuff_report_.normal_force > 0.0) sliding_ += dt / cuff_report_.normal_force * slid;
  strap_report_.wrench = wrench_ - cuff_report_.wrench;
  rate_ = free_rate_ - tissue_response_ * force;
  point_rate_ = free_point_rate_ + point_follow_ * twist +
                point_response_ * force.tail(static_cast<Index>(strap_touches_.size()));
  displacement_ += dt * rate_;
  for (int k = 0; k < strap.moving(); ++k) points_.col(k) += dt * point_rate_.segment<3>(3 * k);
  twist_ = twist;
}

Wrench InterfaceRun::impose(const LimbPose& pose, const Twist& twist) {
  begin(pose);
  for (int i = 0; i < 30 && settle(twist); ++i) {
  }
  finish(twist);
  return wrench_;
}

Vector InterfaceRun::pressure() const {
  Vector pressure = cuff_force_;
  for (Index i = 0; i < pressure.size(); ++i)
    pressure[i] /= model_->tissue().mesh().area(static_cast<int>(i));
  return pressure;
}

double InterfaceRun::energy(const LimbPose& pose) const {
  const Strap& strap = model_->strap();
  const double pad = model_->options().pad_stiffness;
  double energy = model_->tissue().energy(displacement_, rate_) +
                  strap.webbing(points_, rest_).energy +
                  0.5 * strap.point_mass() * point_rate_.squaredNorm();
  const auto add = [&](double depth, double area) {
    if (depth > 0.0) energy += 0.5 * pad * area * depth * depth;
  };
  for (const int i : covered_) {
    const CuffTouch t = cuff_touch(pose, i);
    if (t.slope > 0.0) add(t.depth, model_->tissue().mesh().area(i));
  }
  for (int k = 0; k < strap.moving(); ++k) add(strap_touch(pose, k).depth, strap.area());
  return energy;
}

}  // namespace ulna
