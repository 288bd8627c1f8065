// The log of a mobilisation, row by row, and the Record that comes of it.
#pragma once

#include <vector>

#include "plant/mobilised.hpp"
#include "sim/mobilisation.hpp"

namespace ulna::sim {

class JointLog {
 public:
  JointLog(const MobilisedPlant& plant, std::vector<Index> moved, double rate_hz);

  // Slip counts from here: the arm as it was donned.
  void donned(MobilisedRun& run);

  // Both sides of a step: what a state is, then what acted there.
  void before_step(MobilisedRun& run, const VectorRef& reference);
  void after_step(const MobilisedRun& run);

  // Gives the record, its notes and what the log says of the run.
  void finish(const Protocol& protocol, Mobilisation& m) const;

 private:
  struct Row {
    Vector angle, rate, acceleration, motor, loss, reference;  // of the device
    Vector human, human_rate, muscle;
    Vector activation, extras;
    bool whole = false;
  };

  Record record(const Protocol& protocol, const Mobilisation& m) const;
  void notice_limits(Mobilisation& m) const;
  Index whole_rows() const;
  Vector apart(const Vector& angle, const Vector& human) const;  // of the moved joints

  const MobilisedPlant& plant_;
  std::vector<Index> moved_;
  double rate_hz_;
  Vector donned_apart_;
  std::vector<Row> rows_;
};

}  // namespace ulna::sim
