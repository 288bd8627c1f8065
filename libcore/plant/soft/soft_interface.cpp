#include "plant/soft/soft_interface.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

constexpr double kReach = 0.0015;  // contacts this far apart can meet within a step, m

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

Matrix3 across(const Vector3& unit) { return Matrix3::Identity() - unit * unit.transpose(); }

const SoftInterfaceOptions& checked_interface(const SoftInterfaceOptions& options) {
  options.check();
  return options;
}

}  // namespace

// The fitted design, for an arm of the published length: where its middle is
// along the segment, how long it is, and the tissue that it holds. All lengths
// along the limb are the arm's.
constexpr double kPublishedUpperScale = 0.86267;  // of the humerus that reaches the device's elbow

struct FittedShell {
  double middle;  // from the proximal joint, m
  double length;
  double tissue;  // half length
  double radius;
};
constexpr FittedShell kUpperShell{0.160, 0.160, 0.120, 0.0506};
constexpr FittedShell kForeShell{0.165, 0.190, 0.140, 0.0420};
constexpr double kShellHalfAngle = 110.0 * kDegree;

void fit_shell(SoftInterfaceOptions& o, const FittedShell& shell, double factor) {
  o.cuff.set_arc(shell.radius, kShellHalfAngle);
  o.cuff.depth = factor * shell.length;
  o.cuff.squeeze = 0.012;
  o.cuff.tightness = 15e3;
  o.tissue = o.tissue.of_half_length(factor * shell.tissue);
  o.strap.half_width = shell.radius * std::sin(kShellHalfAngle);
  o.strap.anchor = -shell.radius * std::cos(kShellHalfAngle);
  o.strap.pitch = factor * 0.045;
  o.strap.pretension = 150.0;
}

SoftInterfaceOptions SoftInterfaceOptions::upper_arm(double upper_scale, CuffDesign design) {
  SoftInterfaceOptions o{.name = "upper",
                         .cuff = Cuff::upper_arm(),
                         .strap = {.limb = "upper arm"},
                         .tissue = TissueOptions::upper_arm(),
                         .bone = "humerus",
                         .centre = upper_scale * Vector3(0.14, 0.0, 0.0)};
  if (design == CuffDesign::kPublished) return o;
  const double factor = upper_scale / kPublishedUpperScale;
  fit_shell(o, kUpperShell, factor);
  o.centre.x() = factor * kUpperShell.middle;
  // The device's elbow is 0.25 m from its shoulder; the shell lies around the
  // link's axis.
  o.cuff.position = {0.0, o.tissue.semi_axes.z() - o.cuff.face(), kUpperShell.middle - 0.25};
  return o;
}

SoftInterfaceOptions SoftInterfaceOptions::forearm(double fore_scale, CuffDesign design) {
  SoftInterfaceOptions o{.name = "fore",
                         .cuff = Cuff::forearm(),
                         .strap = {.limb = "forearm"},
                         .tissue = TissueOptions::forearm(),
                         .bone = "ulna",
                         .centre = fore_scale * Vector3(0.12, -0.01, 0.015)};
  if (design == CuffDesign::kPublished) return o;
  fit_shell(o, kForeShell, fore_scale);
  o.centre.x() = fore_scale * kForeShell.middle;
  // Around the tissue of an arm that lies in the device's axes.
  o.cuff.position = {0.015, kForeShell.middle, -0.017};
  return o;
}

void SoftInterfaceOptions::check() const {
  cuff.check();
  strap.check();
  tissue.check();
  require(!bone.empty() && centre.allFinite(), "bone",
          "the tissue '" + name + "' must be at a finite place of a bone");
  require(std::isfinite(friction) && friction >= 0.0 && friction <= 10.0, "friction",
          "the friction of '" + name + "' must be between 0 and 10");
  require(std::isfinite(shear) && shear > 0.0, "shear",
          "the skin of '" + name + "' must have a positive stiffness against shear");
  require(std::isfinite(pad_stiffness) && pad_stiffness > 0.0, "pad_stiffness",
          "the pads of '" + name + "' must have a positive stiffness");
}

SoftInterface::SoftInterface(const SoftInterfaceOptions& options)
    : options_(checked_interface(options)),
      tissue_(options.tissue),
      strap_(options.strap),
      shear_stiffness_(options.shear_stiffness()) {
  for (int plate = 0; plate < Cuff::kPlates; ++plate) {
    outward_[static_cast<std::size_t>(plate)] = options_.cuff.outward(plate);
  }
}

InterfaceRun::InterfaceRun(std::shared_ptr<const SoftInterface> model,
                           std::shared_ptr<const TissueStep> step)
    : model_(std::move(model)), step_(std::move(step)) {}

void InterfaceRun::don(const LimbPose& pose) {
  const Tissue& tissue = model_->tissue();
  const Strap& strap = model_->strap();
  donned_pose_ = pose;
  displacement_ = rate_ = Vector::Zero(tissue.size());
  cuff_force_ = Vector::Zero(tissue.size() * Cuff::kPlates);
  point_rate_ = Vector::Zero(3 * strap.moving());
  strap_force_ = Vector::Zero(strap.moving());
  cuff_bristle_.assign(static_cast<std::size_t>(cuff_force_.size()), {});
  strap_bristle_.assign(static_cast<std::size_t>(strap.moving()), {});
  sliding_.setZero();
  covered_.clear();
  for (int i = 0; i < tissue.size(); ++i) {
    const Vector3 at = pose.position + pose.orientation * tissue.mesh().point(i);
    if (std::fabs(at.z()) <= 0.5 * model_->options().cuff.depth) covered_.push_back(i);
  }
  const Vector3 square = tissue.mesh().semi_axes().cwiseAbs2();
  faces_ = model_->options().cuff.faces(
      pose.position, pose.orientation * square.asDiagonal() * pose.orientation.transpose(),
      tissue.options().foundation());
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

void InterfaceRun::come_to_rest(const LimbPose& pose, std::shared_ptr<const TissueStep> slow) {
  constexpr int kSlowSteps = 12;
  std::swap(step_, slow);
  for (int i = 0; i < kSlowSteps; ++i) impose(pose, Twist::Zero());
  std::swap(step_, slow);
  rate_.setZero();
  point_rate_.setZero();
}

InterfaceRun::CuffTouch InterfaceRun::cuff_touch(const LimbPose& pose, int i, int plate) const {
  const TissueMesh& mesh = model_->tissue().mesh();
  const Vector3 radial = pose.orientation * mesh.direction(i);
  CuffTouch touch{.element = i,
                  .plate = plate,
                  .depth = 0.0,
                  .normal = model_->outward(plate),
                  .arm = (mesh.radius(i) + displacement_[i]) * radial,
                  .slope = 0.0};
  touch.depth =
      touch.normal.dot(pose.position + touch.arm) - faces_[static_cast<std::size_t>(plate)];
  touch.slope = touch.normal.dot(radial);
  return touch;
}

InterfaceRun::StrapTouch InterfaceRun::strap_touch(const LimbPose& pose, int k) const {
  StrapTouch touch{.point = k, .depth = 0.0, .place = {}, .normal = {}, .arm = {}};
  touch.arm = points_.col(k) - pose.position;
  const Vector3 at = pose.orientation.transpose() * touch.arm;
  touch.place = model_->tissue().mesh().place(at);
  Vector bulge(touch.place.share.size());
  for (Index a = 0; a < bulge.size(); ++a) {
    bulge[a] = displacement_[touch.place.element[static_cast<std::size_t>(a)]];
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
  // Where two plates meet an element may lie on both.
  for (const int i : covered_) {
    for (int plate = 0; plate < Cuff::kPlates; ++plate) {
      const CuffTouch touch = cuff_touch(pose, i, plate);
      if (touch.depth > -kReach && touch.slope > 0.0) cuff_touches_.push_back(touch);
    }
  }
  for (int k = 0; k < model_->strap().moving(); ++k) {
    StrapTouch touch = strap_touch(pose, k);
    if (touch.depth > -kReach) strap_touches_.push_back(std::move(touch));
  }
}

// A bristle keeps `hold` of its stretch at the end of the step, with the
// friction's limit known from the step before: whatever it is (0 to 1), the
// step makes no energy.
Vector3 InterfaceRun::relax(Bristle& bristle, const Vector3& trial, const Vector3& velocity,
                            double normal_force, double stiffness) const {
  const double limit = model_->options().friction * normal_force / stiffness;
  const auto within = [limit](double length) { return length > limit ? limit / length : 1.0; };
  bristle.stretch = bristle.hold * trial;
  bristle.stretch *= within(bristle.stretch.norm());
  bristle.hold = within((bristle.stretch + step_->timestep() * velocity).norm());
  return trial - bristle.stretch;
}

// Friction: of the cuff between bone and link, of the strap between its points
// and the bone. Leaves the strap's free motion and how its points follow the
// limb and contact forces.
void InterfaceRun::add_friction() {
  const Strap& strap = model_->strap();
  const TissueMesh& mesh = model_->tissue().mesh();
  const double dt = step_->timestep();
  friction_bias_.setZero();
  friction_resistance_.setZero();
  for (const CuffTouch& t : cuff_touches_) {
    Bristle& bristle = cuff_bristle_[slot(t)];
    if (cuff_force_[static_cast<Index>(slot(t))] <= 0.0) continue;
    const Matrix3 tangent = across(t.normal);
    bristle.stretch = tangent * bristle.stretch;
    const Jacobian slide = tangent * velocity_at(t.arm);
    const double stiffness = bristle.hold * shear(mesh.area(t.element));
    friction_bias_ -= stiffness * slide.transpose() * bristle.stretch;
    friction_resistance_ += dt * stiffness * slide.transpose() * slide;
  }
  cuff_friction_ = friction_resistance_;
  const Strap::Webbing web = strap.webbing(points_, rest_);
  tension_ = web.tension;
  Matrix system = web.damping + dt * web.stiffness;
  system.diagonal().array() += strap.point_mass() / dt;
  const Index n = 3 * strap.moving();
  const auto contacts = static_cast<Index>(strap_touches_.size());
  Matrix right = Matrix::Zero(n, contacts + 7);
  right.col(contacts + 6) = strap.point_mass() / dt * point_rate_ + web.force;
  Wrench pulled = Wrench::Zero();
  for (Index k = 0; k < contacts; ++k) {
    const StrapTouch& t = strap_touches_[static_cast<std::size_t>(k)];
    const Index row = 3 * t.point;
    right.block<3, 1>(row, k) = t.normal;
    if (strap_force_[t.point] <= 0.0) continue;
    const Matrix3 tangent = across(t.normal.normalized());
    const Jacobian carry = tangent * velocity_at(t.arm);
    Bristle& bristle = strap_bristle_[static_cast<std::size_t>(t.point)];
    const Vector3 stretch = tangent * (orientation_ * bristle.stretch);
    bristle.stretch = orientation_.transpose() * stretch;
    // The bristle is stretched by the point's motion against the limb and pulls
    // it back.
    const double stiffness = bristle.hold * shear(strap.area());
    system.block<3, 3>(row, row) += dt * stiffness * tangent;
    right.block<3, 6>(row, contacts) = dt * stiffness * carry;
    right.block<3, 1>(row, contacts + 6) -= stiffness * stretch;
    pulled += stiffness * carry.transpose() * stretch;
    friction_resistance_ += dt * stiffness * carry.transpose() * carry;
  }
  const Matrix pull = right.middleCols(contacts, 6);
  system.llt().solveInPlace(right);
  point_response_ = right.leftCols(contacts);
  point_follow_ = right.middleCols(contacts, 6);
  free_point_rate_ = right.col(contacts + 6);
  friction_bias_ += pulled + pull.transpose() * free_point_rate_;
  friction_resistance_ -= pull.transpose() * point_follow_;
}

void InterfaceRun::write_problem() {
  const SoftInterfaceOptions& o = model_->options();
  const TissueMesh& mesh = model_->tissue().mesh();
  const double dt = step_->timestep();
  const auto cuffs = static_cast<Index>(cuff_touches_.size());
  const auto straps = static_cast<Index>(strap_touches_.size());
  const Index n = cuffs + straps;
  ContactProblem& problem = law_.problem();
  problem.timestep = dt;
  problem.resize(n, 6);
  tissue_response_.resize(mesh.size(), n);
  Eigen::Map<Matrix> tissue_response = tissue_response_.view();
  for (Index k = 0; k < cuffs; ++k) {
    const CuffTouch& t = cuff_touches_[static_cast<std::size_t>(k)];
    tissue_response.col(k) = t.slope * step_->compliance().col(t.element);
    problem.stiffness[k] = o.pad_stiffness * mesh.area(t.element);
    problem.penetration[k] = t.depth + dt * t.slope * free_rate_[t.element];
    problem.approach.row(k) = row_of(t);
    problem.active[static_cast<std::size_t>(k)] = t.depth > 0.0 ? 1 : 0;
  }
  for (Index k = 0; k < straps; ++k) {
    const StrapTouch& t = strap_touches_[static_cast<std::size_t>(k)];
    const Index c = cuffs + k;
    tissue_response.col(c).setZero();
    double bulging = 0.0;
    for (Index a = 0; a < t.place.share.size(); ++a) {
      const int i = t.place.element[static_cast<std::size_t>(a)];
      tissue_response.col(c) += t.place.share[a] * step_->compliance().col(i);
      bulging += t.place.share[a] * free_rate_[i];
    }
    problem.stiffness[c] = o.pad_stiffness * model_->strap().area();
    problem.penetration[c] =
        t.depth + dt * (bulging - t.normal.dot(free_point_rate_.segment<3>(3 * t.point)));
    problem.approach.row(c) = row_of(t);
    problem.approach.row(c) -= t.normal.transpose() * point_follow_.middleRows<3>(3 * t.point);
    problem.active[static_cast<std::size_t>(c)] = t.depth > 0.0 ? 1 : 0;
  }
  Eigen::Map<Matrix> mobilities = problem.mobility.view();
  for (Index c = 0; c < n; ++c) {
    const double* response = tissue_response.col(c).data();
    double* mobility = mobilities.col(c).data();
    for (Index k = 0; k < cuffs; ++k) {
      const CuffTouch& t = cuff_touches_[static_cast<std::size_t>(k)];
      mobility[k] = t.slope * response[t.element];
    }
    for (Index k = 0; k < straps; ++k) {
      const StrapTouch& t = strap_touches_[static_cast<std::size_t>(k)];
      double sum =
          c < cuffs ? 0.0 : t.normal.dot(point_response_.col(c - cuffs).segment<3>(3 * t.point));
      for (Index a = 0; a < t.place.share.size(); ++a) {
        sum += t.place.share[a] * response[t.place.element[static_cast<std::size_t>(a)]];
      }
      mobility[cuffs + k] = sum;
    }
  }
  law_.begin();
}

void InterfaceRun::begin(const LimbPose& pose) {
  orientation_ = pose.orientation;
  free_rate_ = step_->free_rate(displacement_, rate_);
  find_touches(pose);
  add_friction();
  write_problem();
}

void InterfaceRun::condense(Wrench& bias, Matrix6& resistance) const {
  Vector b = friction_bias_;
  Matrix r = friction_resistance_;
  law_.condense(b, r);
  bias = b;
  resistance = r;
}

Matrix6 InterfaceRun::cuff_resistance() const {
  Vector bias = Vector::Zero(6);
  Matrix resistance = cuff_friction_;
  law_.condense(bias, resistance, static_cast<Index>(cuff_touches_.size()));
  return resistance;
}

bool InterfaceRun::settle(const Twist& twist) { return law_.settle(twist); }

void InterfaceRun::finish(const Twist& twist) {
  const TissueMesh& mesh = model_->tissue().mesh();
  const Strap& strap = model_->strap();
  const double dt = step_->timestep();
  Wrench bias;
  Matrix6 resistance;
  condense(bias, resistance);
  wrench_ = bias - resistance * twist;
  const Vector& force = law_.force();
  const auto cuffs = static_cast<Index>(cuff_touches_.size());
  cuff_report_ = strap_report_ = {};
  Vector3 slid = Vector3::Zero();
  Vector cuff_before = Vector::Zero(cuff_force_.size());
  for (const CuffTouch& t : cuff_touches_) {
    const auto i = static_cast<Index>(slot(t));
    cuff_before[i] = cuff_force_[i];
  }
  Vector strap_before = Vector::Zero(strap_force_.size());
  for (const StrapTouch& t : strap_touches_) strap_before[t.point] = strap_force_[t.point];
  cuff_force_.setZero();
  strap_force_.setZero();
  for (std::size_t i = 0; i < cuff_bristle_.size(); ++i) {
    if (cuff_before[static_cast<Index>(i)] <= 0.0) cuff_bristle_[i] = {};
  }
  for (std::size_t i = 0; i < strap_bristle_.size(); ++i) {
    if (strap_before[static_cast<Index>(i)] <= 0.0) strap_bristle_[i] = {};
  }
  const auto count = [](ContactReport& report, double newtons, double area) {
    report.normal_force += newtons;
    report.area += newtons > 0.0 ? area : 0.0;
    report.peak_pressure = std::max(report.peak_pressure, newtons / area);
  };
  for (Index k = 0; k < cuffs; ++k) {
    const CuffTouch& t = cuff_touches_[static_cast<std::size_t>(k)];
    const auto at = static_cast<Index>(slot(t));
    cuff_force_[at] = force[k];
    cuff_report_.wrench -= force[k] * row_of(t);
    Bristle& bristle = cuff_bristle_[slot(t)];
    if (cuff_before[at] <= 0.0) continue;
    const Jacobian slide = across(t.normal) * velocity_at(t.arm);
    const Vector3 velocity = slide * twist;
    const Vector3 trial = bristle.stretch + dt * velocity;
    const double stiffness = shear(mesh.area(t.element));
    cuff_report_.wrench -= bristle.hold * stiffness * slide.transpose() * trial;
    slid += force[k] * relax(bristle, trial, velocity, force[k], stiffness);
  }
  for (std::size_t k = 0; k < strap_touches_.size(); ++k) {
    const StrapTouch& t = strap_touches_[k];
    const double newtons = force[cuffs + static_cast<Index>(k)];
    strap_force_[t.point] = newtons;
    count(strap_report_, newtons * t.normal.norm(), strap.area());
  }
  for (const int i : covered_) {
    count(cuff_report_, cuff_force_.segment<Cuff::kPlates>(i * Cuff::kPlates).sum(), mesh.area(i));
  }
  if (cuff_report_.normal_force > 0.0) sliding_ += slid / cuff_report_.normal_force;
  strap_report_.wrench = wrench_ - cuff_report_.wrench;
  rate_ = free_rate_;
  rate_.noalias() -= std::as_const(tissue_response_).view() * force;
  point_rate_ = free_point_rate_ + point_follow_ * twist +
                point_response_ * force.tail(static_cast<Index>(strap_touches_.size()));
  for (const StrapTouch& t : strap_touches_) {
    Bristle& bristle = strap_bristle_[static_cast<std::size_t>(t.point)];
    if (strap_before[t.point] <= 0.0) continue;
    const Vector3 apart = point_rate_.segment<3>(3 * t.point) - velocity_at(t.arm) * twist;
    const Vector3 velocity = orientation_.transpose() * across(t.normal.normalized()) * apart;
    relax(bristle, bristle.stretch + dt * velocity, velocity,
          strap_force_[t.point] * t.normal.norm(), shear(strap.area()));
  }
  displacement_ += dt * rate_;
  for (int k = 0; k < strap.moving(); ++k) points_.col(k) += dt * point_rate_.segment<3>(3 * k);
}

Wrench InterfaceRun::impose(const LimbPose& pose, const Twist& twist) {
  begin(pose);
  for (int i = 0; i < 30 && settle(twist); ++i) {
  }
  finish(twist);
  return wrench_;
}

Vector InterfaceRun::pressure() const {
  const TissueMesh& mesh = model_->tissue().mesh();
  Vector pressure(mesh.size());
  for (int i = 0; i < mesh.size(); ++i) {
    pressure[i] = cuff_force_.segment<Cuff::kPlates>(i * Cuff::kPlates).sum() / mesh.area(i);
  }
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
    for (int plate = 0; plate < Cuff::kPlates; ++plate) {
      const CuffTouch t = cuff_touch(pose, i, plate);
      if (t.slope > 0.0) add(t.depth, model_->tissue().mesh().area(i));
    }
  }
  for (int k = 0; k < strap.moving(); ++k) add(strap_touch(pose, k).depth, strap.area());
  for (std::size_t i = 0; i < cuff_bristle_.size(); ++i) {
    energy += 0.5 * shear(model_->tissue().mesh().area(static_cast<int>(i) / Cuff::kPlates)) *
              cuff_bristle_[i].stretch.squaredNorm();
  }
  for (const Bristle& b : strap_bristle_) {
    energy += 0.5 * shear(strap.area()) * b.stretch.squaredNorm();
  }
  return energy;
}

}  // namespace ulna
