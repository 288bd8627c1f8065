// The second-order filter through which steps are passed before a robot follows them,
//     G(s) = w^2 / (s^2 + 2 zeta w s + w^2)        (3.5) of Dyck 2013,
// evaluated in closed form for any damping: no integration, no error that grows with time.
#pragma once

namespace ulna {

struct SecondOrder {
  double damping_ratio = 0.1;   // zeta
  double natural_rad_s = 15.0;  // w
};

// Throws Error (kArgument) unless 0 < damping_ratio <= 100 and natural_rad_s is positive.
void check_second_order(const SecondOrder& filter);

// A signal with its first two derivatives, per s and s^2.
struct SignalPoint {
  double value = 0.0;
  double rate = 0.0;
  double acceleration = 0.0;
};

// What remains, t_s after it was there, of a state (value, rate) when the input is zero.
SignalPoint free_response(const SecondOrder& filter, double value, double rate, double t_s);

// Response to an input that steps from 0 to 1 at t = 0, at rest before; zero for t_s < 0.
SignalPoint step_response(const SecondOrder& filter, double t_s);

struct StepFacts {
  double overshoot = 0.0;    // share of the step: exp(-pi zeta / sqrt(1 - zeta^2)); 0 from zeta = 1
  double peak_time_s = 0.0;  // pi / (w sqrt(1 - zeta^2)); infinite from zeta = 1
  double settling_s = 0.0;   // to 2 %: four time constants of the slowest pole
};

StepFacts step_facts(const SecondOrder& filter);

}  // namespace ulna
