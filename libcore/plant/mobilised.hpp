// What the protocol of an assessment needs of a plant, whichever it is: a device on joints that
// motors turn, an arm in it with joints of its own, and muscles. A MobilisedPlant is immutable and
// shared by threads, a MobilisedRun belongs to one.
//
// Angles rad, torques N m, excitation and activation 0 to 1. A torque is positive that turns its
// joint towards positive angles. Vectors are in the order of the names that the plant gives.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "plant/arm_description.hpp"
#include "plant/nominal_model.hpp"

namespace ulna {

// Something else that a plant can log: forces at cuffs and straps, displacement of an attachment.
struct PlantChannel {
  std::string name;  // "F_fore_cuff", "slip_fore"
  std::string unit;  // SI: "N", "m", ...
};

class MobilisedRun {
 public:
  virtual ~MobilisedRun() = default;
  MobilisedRun() = default;
  MobilisedRun(const MobilisedRun&) = delete;
  MobilisedRun& operator=(const MobilisedRun&) = delete;

  // At the present instant.
  virtual Vector device_angle() = 0;
  virtual Vector device_rate() = 0;
  virtual Vector human_angle() = 0;
  virtual Vector human_rate() = 0;

  // Holds from now on: torque of the motors without added damping, excitation of the muscles.
  virtual void command(const VectorRef& motor_torque, const VectorRef& excitation) = 0;

  // One time step on. Throws Error when the run cannot go on: kAnalysis for motion that diverged,
  // kUnsupported for what the plant cannot compute (contacts, muscles), kData for numbers that are
  // not finite. The run can then only be freed.
  virtual void step() = 0;

  // What acted in the last step(), from the state that it left:
  //   M(q) a + c(q, v) + loss = motor + muscle   at each joint, where nothing
  //   else holds it.
  virtual Vector device_acceleration() const = 0;  // change of the rate over the step
  virtual Vector device_loss() const = 0;    // damping and friction of the device, N m, opposing
  virtual Vector motor_torque() const = 0;   // with added damping
  virtual Vector muscle_torque() const = 0;  // of all muscles, on each human joint
  virtual Vector activation() const = 0;
  virtual Vector muscle_length() const = 0;  // over the optimal length
  virtual Vector muscle_rate() const = 0;    // its derivative, 1/s; positive: stretched
  virtual Vector extras() const = 0;
};

// The muscles alone, at any state of the human joints.
class MuscleProbe {
 public:
  virtual ~MuscleProbe() = default;
  MuscleProbe() = default;
  MuscleProbe(const MuscleProbe&) = delete;
  MuscleProbe& operator=(const MuscleProbe&) = delete;

  // Torque on each human joint, N m.
  virtual Vector torque(const VectorRef& human_angle, const VectorRef& human_rate,
                        const VectorRef& activation) = 0;
};

class MobilisedPlant {
 public:
  virtual ~MobilisedPlant() = default;
  MobilisedPlant() = default;
  MobilisedPlant(const MobilisedPlant&) = delete;
  MobilisedPlant& operator=(const MobilisedPlant&) = delete;

  virtual const std::vector<std::string>& device_joints() const = 0;
  virtual const std::vector<std::string>& human_joints() const = 0;
  virtual const std::vector<std::string>& muscles() const = 0;
  virtual const std::vector<MuscleGroup>& groups() const = 0;  // of each muscle
  virtual const std::vector<PlantChannel>& extras() const = 0;
  // Human joint that a device joint turns, -1 for none.
  virtual const std::vector<Index>& counterparts() const = 0;

  virtual double timestep() const = 0;      // s
  virtual Vector reference() const = 0;     // device joints, the pose in which it is written
  virtual Matrix device_range() const = 0;  // device joints x 2
  virtual Matrix human_range() const = 0;   // human joints x 2
  virtual Vector motor_limit() const = 0;   // N m either way, one a device joint

  // Made from the same description.
  virtual const NominalModel& nominal() const = 0;

  // At rest with the device at an angle and the arm in it as donned, muscles without activation.
  // added_damping (one a device joint, N m s/rad) acts implicitly beside the joints' own.
  virtual std::unique_ptr<MobilisedRun> start(const VectorRef& device_angle,
                                              const VectorRef& added_damping) const = 0;
  virtual std::unique_ptr<MuscleProbe> probe() const = 0;
};

}  // namespace ulna
