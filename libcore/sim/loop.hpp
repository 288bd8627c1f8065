// The closed loop of robot and human, integrated at a fixed step: between two instants of the
// sampled controller the torque is constant and the human's own force linear in time, and the
// motion is a smooth differential equation for Runge-Kutta's fourth-order method.
#pragma once

#include <vector>

#include "base/token.hpp"
#include "sim/coloured.hpp"
#include "sim/description.hpp"

namespace ulna::sim {

// Rate of the control: that asked for, raised to a multiple of the record's rate.
double control_rate(const Experiment& experiment);

// What holds at one instant of the control, in the frame of the record. A torque jumps at the
// instant, and with it force and acceleration: they are the means of before and after, so that
// sampled signals are not half a step early.
struct Instant {
  Vector2 angle, position, velocity, acceleration, torque;
  Vector2 force;   // by the human on the robot, at the sensor
  Vector2 cns;     // its voluntary part
  Vector2 tremor;  // and the rest of the human's own
  double cocontraction = 0.0;
};

// The last values of a signal, for a delay of any length.
class History {
 public:
  // Up to `steps` back.
  explicit History(double steps);

  void push(const Vector2& value) noexcept;
  // Linear between samples; before the first value the first one.
  Vector2 back(double steps) const noexcept;

 private:
  const Vector2& at(Index steps) const noexcept;

  std::vector<Vector2> ring_;
  Index pushed_ = 0;
};

// State of one run: belongs to one thread. The experiment must outlive it.
class Loop {
 public:
  // offset_m moves the start away from the equilibrium of the reference, for the test of stability;
  // substeps: of the integration in one step of the control, 0 chosen by the fastest mode.
  Loop(const Experiment& experiment, std::uint64_t seed, std::uint64_t run,
       const Vector2& offset_m = Vector2::Zero(), Index substeps = 0);

  // The present instant under a reference and its rate; then to the next. Throws Error (kAnalysis)
  // when the handle runs away or meets a stop.
  Instant advance(const Vector2& reference, const Vector2& reference_rate);

  double step_s() const noexcept { return step_s_; }
  Index limited() const noexcept { return limited_; }  // instants at the limit of the force
  Index substeps() const noexcept { return substeps_; }

 private:
  struct Motion {
    Vector2 angle, rate;
  };
  // What acts during a step, beside the torque.
  struct Pull {
    Vector2 from, to;  // the human's own force at both ends
    Matrix2 b, k;
  };
  // What a state answers: joint acceleration = free + mobility * torque.
  struct Response {
    RobotState robot;  // in the frame of the record
    Vector2 velocity;
    Vector2 arm;  // B x' + K (x - x0)
    Vector2 free;
    Matrix2 mobility;
  };

  RobotState state_of(const Motion& at) const;
  Response respond(const Motion& at, const Pull& pull, const Vector2& own) const;
  Vector2 command(const RobotState& robot, const Vector2& velocity, const Vector2& reference,
                  const Vector2& reference_rate);
  void feel(const Vector2& position, const Vector2& velocity);
  void integrate(const Vector2& first, const Pull& pull, const Vector2& torque);
  void choose_substeps();
  void check_motion(const Vector2& velocity) const;

  const Experiment& e_;
  double step_s_;
  Index substeps_ = 1;
  Matrix2 m_, b_, k_, turn_;
  Vector2 x0_, centre_, target_;
  Motion now_;
  Index count_ = 0;
  Index limited_ = 0;
  Vector2 last_torque_ = Vector2::Zero();
  History commands_;  // on their way through the delay of the control
  // The human.
  ColouredNoise tremor_x_, tremor_y_;
  Vector2 tremor_now_, tremor_next_;
  History positions_, velocities_;
  Vector2 integral_ = Vector2::Zero();
  Vector2 drive_ = Vector2::Zero();  // before the muscles' lag
  Vector2 cns_now_ = Vector2::Zero();
  Vector2 cns_next_ = Vector2::Zero();
  double reaction_ = 0.0;
};

// Pushes the resting loop by 0.1 mm and throws Error (kAnalysis) when the push grows: a loop that
// is unstable gives no recording.
void check_stability(const Experiment& experiment, Token* token = nullptr);

}  // namespace ulna::sim
