// What holds one segment of the arm in the device: a cuff, a strap over its
// opening and the soft tissue between them and the bone. Tissue meets cuff and
// strap by stiff pads that only push, with friction; it does not touch itself.
//
// A step is linearly implicit: springs, dampers and contacts are taken at its
// end, the directions of contacts and webbing at its beginning. Everything
// inside is condensed onto the velocity of the bone against the link (6
// numbers: velocity of the tissue's centre, then rate of turning, in the cuff's
// frame), which the plant solves together with its joints.
#pragma once

#include <memory>

#include "plant/soft/contact_law.hpp"
#include "plant/soft/cuff.hpp"
#include "plant/soft/strap.hpp"
#include "plant/soft/tissue.hpp"

namespace ulna {

// How the arm is held.
enum class CuffDesign {
  // Shells three quarters around the limb, near the far end of its segment and
  // as long as the joints
  // leave room for, lined to the limb and tightened, with a wide strap; lengths
  // follow the arm's.
  kFitted,
  // Short open half shells in the middle of the segments, where the arm turns
  // by 10 to 30 degrees
  // (Tesfazgi 2023): its geometry, with a lining.
  kPublished,
};

struct SoftInterfaceOptions {
  std::string name;  // "upper", "fore": begins the names of outputs
  Cuff cuff;
  StrapOptions strap;
  TissueOptions tissue;
  std::string bone;                  // body that the tissue is around
  Vector3 centre = Vector3::Zero();  // of the tissue in the bone's frame, m
  double friction = 0.7;             // Coulomb coefficient of tissue on cuff and strap
  // Stiffness along the skin before it slides, of that across it: a layer between skin and bone
  // with shear modulus G = E/3 (flesh keeps its volume) is a third as stiff along as across.
  double shear = 1.0 / 3.0;
  double pad_stiffness = 1e8;  // of contacts, N/m for each m^2

  static SoftInterfaceOptions upper_arm(double upper_scale,
                                        CuffDesign design = CuffDesign::kFitted);
  static SoftInterfaceOptions forearm(double fore_scale, CuffDesign design = CuffDesign::kFitted);
  double shear_stiffness() const { return shear * tissue.foundation(); }  // N/m^3
  void check() const;  // throws Error (kArgument)
};

// The bone's tissue frame in the cuff's frame.
struct LimbPose {
  Vector3 position;     // of the tissue's centre, m
  Matrix3 orientation;  // columns: bone axes
};

using Twist = Eigen::Matrix<double, 6, 1>;   // velocity (m/s), rate of turning (rad/s)
using Wrench = Eigen::Matrix<double, 6, 1>;  // force (N), moment about the
                                             // tissue's centre (N m)
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// What cuff or strap do to the limb.
struct ContactReport {
  Wrench wrench = Wrench::Zero();  // on the limb, cuff frame
  double normal_force = 0.0;       // sum of the magnitudes, N
  double peak_pressure = 0.0;      // Pa
  double area = 0.0;               // that is pressed, m^2
};

class SoftInterface {
 public:
  explicit SoftInterface(const SoftInterfaceOptions& options);
  const SoftInterfaceOptions& options() const { return options_; }
  const Tissue& tissue() const { return tissue_; }
  const Strap& strap() const { return strap_; }
  // Of the cuff's plates.
  const Vector3& outward(int plate) const { return outward_[static_cast<std::size_t>(plate)]; }
  double shear_stiffness() const { return shear_stiffness_; }  // N/m^3

 private:
  SoftInterfaceOptions options_;
  Tissue tissue_;
  Strap strap_;
  std::array<Vector3, Cuff::kPlates> outward_;
  double shear_stiffness_;
};

// The moving state of an interface; of one thread at a time.
class InterfaceRun {
 public:
  // Shares the model and the step's matrices.
  InterfaceRun(std::shared_ptr<const SoftInterface> model, std::shared_ptr<const TissueStep> step);

  // Puts the limb in with the tissue in shape and the strap around it. Throws
  // Error (kArgument) when the limb is not in the cuff, and what Strap::don
  // throws.
  void don(const LimbPose& pose);

  // Lets tissue and strap come to rest around the limb, which is held still:
  // some steps of `slow`, the same tissue with a time step that is long against
  // its motion.
  void come_to_rest(const LimbPose& pose, std::shared_ptr<const TissueStep> slow);

  // One step: begin() with the present pose, then condense() and settle() until
  // nothing changes, then finish(). force on the bone = bias - resistance x
  // twist.
  void begin(const LimbPose& pose);
  void condense(Wrench& bias, Matrix6& resistance) const;
  bool settle(const Twist& twist);
  Matrix6 cuff_resistance() const;  // of the resistance, what the cuff does
  void finish(const Twist& twist);

  // A step with the limb's motion given. Returns the wrench on it, its average
  // over the step.
  Wrench impose(const LimbPose& pose, const Twist& twist);

  // Of the last step.
  const ContactReport& cuff() const { return cuff_report_; }
  const ContactReport& strap() const { return strap_report_; }
  double tension() const { return tension_; }                   // of the strap, N
  const Vector& displacement() const { return displacement_; }  // of the elements, outward, m
  const Matrix& strap_points() const { return points_; }        // 3 x points, cuff frame, m
  // How far the skin has slid along the cuff since it was donned, mean over
  // what is pressed, m: what stays when the load goes.
  const Vector3& sliding() const { return sliding_; }
  Vector pressure() const;  // of the cuff on each element, Pa
  const LimbPose& donned() const { return donned_pose_; }
  double timestep() const { return step_->timestep(); }  // s

  // From now on in steps of another length of the same tissue.
  void use(std::shared_ptr<const TissueStep> step) { step_ = std::move(step); }

  // Of tissue, webbing and contact pads at a pose, and of their motion, J.
  double energy(const LimbPose& pose) const;

 private:
  // Friction of one contact: skin and lining are a spring along the surface
  // that slides where it would pull more than the friction holds.
  struct Bristle {
    Vector3 stretch = Vector3::Zero();  // m
    double hold = 1.0;                  // share of the stretch that friction lets it keep
  };
  struct CuffTouch {
    int element;
    int plate;
    double depth;
    Vector3 normal;  // outward
    Vector3 arm;     // from the tissue's centre
    double slope;    // of its direction on the normal
  };
  struct StrapTouch {
    int point;
    double depth;
    SurfacePlace place;
    Vector3 normal;  // gradient of the distance, cuff frame
    Vector3 arm;
  };

  void find_touches(const LimbPose& pose);
  void write_problem();
  void add_friction();
  CuffTouch cuff_touch(const LimbPose& pose, int element, int plate) const;
  static std::size_t slot(const CuffTouch& t) {
    return static_cast<std::size_t>(t.element * Cuff::kPlates + t.plate);
  }
  StrapTouch strap_touch(const LimbPose& pose, int point) const;
  Twist row_of(const CuffTouch& touch) const;
  Twist row_of(const StrapTouch& touch) const;
  // After a step that stretched it to `trial`. Returns how far it slid.
  Vector3 relax(Bristle& bristle, const Vector3& trial, const Vector3& velocity,
                double normal_force, double stiffness) const;
  double shear(double area) const { return model_->shear_stiffness() * area; }  // N/m

  std::shared_ptr<const SoftInterface> model_;
  std::shared_ptr<const TissueStep> step_;
  LimbPose donned_pose_{Vector3::Zero(), Matrix3::Identity()};
  std::vector<int> covered_;  // elements under the cuff
  Cuff::Faces faces_{};
  Vector displacement_, rate_;
  Matrix points_;
  Vector point_rate_;
  std::vector<double> rest_;
  Vector cuff_force_;                   // of each plate on each element, N: of the last step, for
                                        // friction
  Vector strap_force_;                  // of each moving point
  std::vector<Bristle> cuff_bristle_;   // of each plate and element, cuff frame
  std::vector<Bristle> strap_bristle_;  // of each moving point, axes of the limb
  Matrix3 orientation_ = Matrix3::Identity();  // of the limb in the step

  std::vector<CuffTouch> cuff_touches_;
  std::vector<StrapTouch> strap_touches_;
  Vector free_rate_, free_point_rate_;
  Matrix point_response_;          // moving points x contacts of the strap: velocity for
                                   // forces
  Matrix point_follow_;            // moving points x 6: velocity for the limb's, by friction
  GrowingMatrix tissue_response_;  // elements x contacts
  Wrench friction_bias_;
  Matrix6 friction_resistance_;
  Matrix6 cuff_friction_;  // part of it
  ContactLaw law_;
  Wrench wrench_ = Wrench::Zero();
  ContactReport cuff_report_, strap_report_;
  double tension_ = 0.0;
  Vector3 sliding_ = Vector3::Zero();
};

}  // namespace ulna
