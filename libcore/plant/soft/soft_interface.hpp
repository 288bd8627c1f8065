// What holds one segment of the arm in the device: a cuff, a strap over its opening and the soft
// tissue between them and the bone. Tissue meets cuff and strap by stiff pads that only push, with
// friction; it does not touch itself.
//
// A step is linearly implicit: springs, dampers and contacts are taken at its end, the directions
// of contacts and webbing at its beginning. Everything inside is condensed onto the velocity of the
// bone against the link (6 numbers: velocity of the tissue's centre, then rate of turning, in the
// cuff's frame), which the plant solves together with its joints.
#pragma once

#include <memory>
#include <optional>

#include "plant/soft/contact_law.hpp"
#include "plant/soft/cuff.hpp"
#include "plant/soft/strap.hpp"
#include "plant/soft/tissue.hpp"

namespace ulna {

struct SoftInterfaceOptions {
  std::string name;  // "upper", "fore": begins the names of outputs
  Cuff cuff;
  StrapOptions strap;
  TissueOptions tissue;
  std::string bone;                  // body that the tissue is around
  Vector3 centre = Vector3::Zero();  // of the tissue in the bone's frame, m
  double friction = 0.7;             // Coulomb coefficient of tissue on cuff and strap
  double creep_speed = 2e-4;         // below which friction is viscous, m/s
  double pad_stiffness = 1e8;        // of contacts, N/m for each m^2

  static SoftInterfaceOptions upper_arm(double upper_scale);
  static SoftInterfaceOptions forearm(double fore_scale);
  void check() const;  // throws Error (kArgument)
};

// The bone's tissue frame in the cuff's frame.
struct LimbPose {
  Vector3 position;     // of the tissue's centre, m
  Matrix3 orientation;  // columns: bone axes
};

using Twist = Eigen::Matrix<double, 6, 1>;   // velocity (m/s), rate of turning (rad/s)
using Wrench = Eigen::Matrix<double, 6, 1>;  // force (N), moment about the tissue's centre (N m)
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

 private:
  SoftInterfaceOptions options_;
  Tissue tissue_;
  Strap strap_;
};

// The moving state of an interface; of one thread at a time.
class InterfaceRun {
 public:
  // Shares the model and the step's matrices.
  InterfaceRun(std::shared_ptr<const SoftInterface> model, std::shared_ptr<const TissueStep> step);

  // Puts the limb in with the tissue in shape and the strap around it. Throws Error (kArgument)
  // when the limb is not in the cuff, and what Strap::don throws.
  void don(const LimbPose& pose);

  // One step: begin() with the present pose, then condense() and settle() until nothing changes,
  // then finish(). force on the bone = bias - resistance x twist.
  void begin(const LimbPose& pose);
  void condense(Wrench& bias, Matrix6& resistance) const;
  bool settle(const Twist& twist);
  void finish(const Twist& twist);

  // A step with the limb's motion given. Returns the wrench on it, its average over the step.
  Wrench impose(const LimbPose& pose, const Twist& twist);

  // Of the last step.
  const ContactReport& cuff() const { return cuff_report_; }
  const ContactReport& strap() const { return strap_report_; }
  double tension() const { return tension_; }                   // of the strap, N
  const Vector& displacement() const { return displacement_; }  // of the elements, outward, m
  const Matrix& strap_points() const { return points_; }        // 3 x points, cuff frame, m
  const Vector3& sliding() const { return sliding_; }  // of the skin along the cuff since donned, m
  Vector pressure() const;                             // of the cuff on each element, Pa
  const LimbPose& donned() const { return donned_pose_; }

  // Of tissue, webbing and contact pads at a pose, and of their motion, J.
  double energy(const LimbPose& pose) const;

 private:
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
  CuffTouch cuff_touch(const LimbPose& pose, int element) const;
  StrapTouch strap_touch(const LimbPose& pose, int point) const;
  Twist row_of(const CuffTouch& touch) const;
  Twist row_of(const StrapTouch& touch) const;

  std::shared_ptr<const SoftInterface> model_;
  std::shared_ptr<const TissueStep> step_;
  LimbPose donned_pose_{Vector3::Zero(), Matrix3::Identity()};
  std::vector<int> covered_;  // elements under the cuff
  Cuff::Faces faces_{};
  Vector displacement_, rate_;
  Matrix points_;
  Vector point_rate_;
  std::vector<double> rest_;
  mutable std::vector<int> near_;
  Vector cuff_force_;   // of each element, N: of the last step, for friction
  Vector strap_force_;  // of each moving point
  Twist twist_ = Twist::Zero();

  std::vector<CuffTouch> cuff_touches_;
  std::vector<StrapTouch> strap_touches_;
  Vector free_rate_, free_point_rate_;
  Matrix point_response_;   // moving points x contacts of the strap: velocity for forces
  Matrix point_follow_;     // moving points x 6: velocity for the limb's, by friction
  Matrix tissue_response_;  // elements x contacts
  Wrench friction_bias_;
  Matrix6 friction_resistance_;
  std::optional<ContactLaw> law_;
  Wrench wrench_ = Wrench::Zero();
  ContactReport cuff_report_, strap_report_;
  double tension_ = 0.0;
  Vector3 sliding_ = Vector3::Zero();
};

}  // namespace ulna
