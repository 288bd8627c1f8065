// What stands behind the typed pointers of the interface.
#pragma once

#include <ulna/base.h>

#include <memory>
#include <string>
#include <vector>

#include "base/token.hpp"
#include "estimate/body_recording.hpp"
#include "ident/force_errors.hpp"
#include "ident/order_search.hpp"
#include "ident/robot_parameters.hpp"
#include "ident/sensor_check.hpp"
#include "impedance/delayed.hpp"
#include "impedance/estimate.hpp"
#include "impedance/force_budget.hpp"
#include "impedance/plan.hpp"
#include "impedance/reflex.hpp"
#include "impedance/safety.hpp"
#include "impedance/viscoelastic.hpp"
#include "impedance/window.hpp"
#include "passivity/verdict.hpp"
#include "plant/engine/renderer.hpp"
#include "plant/exo_plant.hpp"
#include "plant/parity_plant.hpp"
#include "plant/planar_robot.hpp"
#include "plant/soft/plant_difference.hpp"
#include "plant/soft/soft_plant.hpp"
#include "plant/soft_scenery.hpp"
#include "record/csv.hpp"
#include "record/mvnx_frames.hpp"
#include "signal/excitation.hpp"
#include "signal/system.hpp"
#include "sim/mobilisation.hpp"
#include "study/indices.hpp"
#include "study/journal.hpp"
#include "study/sampling.hpp"
#include "vision/picture.hpp"

struct ulna_token {
  ulna::Token token;
};

struct ulna_record {
  ulna::Record record;
  std::vector<ulna::Finding> findings;
  ulna::Source source;
  bool is_text = false;  // the source was a text table
};

struct ulna_mvnx_frames {
  ulna::MvnxFrames frames;
};

struct ulna_impedance {
  ulna::ImpedanceEstimate estimate;
};

struct ulna_passivity {
  ulna::Verdict verdict;
};

struct ulna_robot {
  std::shared_ptr<const ulna::PlanarRobot> robot;
};

struct ulna_design {
  ulna::Excitation excitation;
};

struct ulna_safety {
  ulna::Safety safety;
  std::string words;
};

struct ulna_plan {
  ulna::Plan plan;
};

struct ulna_sensed {
  ulna::Record record;
  ulna::ForceErrors errors;
  ulna::Matrix random;  // rows x 6 of a virtual sensor, else empty
  ulna::Matrix total;   // rows x axes
  bool accelerometer = false;
  double worst_quality = 1.0;
  ulna::Index worst_row = 0;
  double lowpass_hz = 0.0;
};

struct ulna_force_budget {
  ulna::ForceBudget budget;
};

struct ulna_sensor_check {
  ulna::SensorCheck check;
};

struct ulna_robot_fit {
  ulna::RobotFit fit;
};

struct ulna_sampling {
  std::shared_ptr<const ulna::Sampling> sampling;
};

struct ulna_journal {
  std::unique_ptr<ulna::Journal> journal;
};

struct ulna_indices {
  ulna::Indices indices;
  bool independent_steps = false;  // of the design
};

struct ulna_model {
  ulna::RationalFit fit;
};

struct ulna_order_search {
  ulna::OrderSearch search;
};

struct ulna_reflex {
  ulna::ReflexEstimate estimate;
};

struct ulna_delayed {
  ulna::DelayedEstimate estimate;
};

struct ulna_windows {
  ulna::WindowComparison comparison;
};

struct ulna_system {
  ulna::System system;
};

struct ulna_plant {
  ulna::ExoPlant plant;
  std::shared_ptr<const ulna::SoftPlant> soft = nullptr;  // where soft interfaces hold the arm
  std::shared_ptr<const ulna::ParityPlant> published = nullptr;  // the published simulation
};

struct ulna_run {
  ulna::EngineRun run;
  std::shared_ptr<const ulna::SoftPlant> soft = nullptr;
};

struct ulna_renderer {
  ulna::Renderer renderer;
  std::shared_ptr<const ulna::SoftPlant> soft;  // whose interfaces are drawn
  ulna::InterfaceLook look;
  bool plain = false;        // interfaces are not drawn
  std::vector<float> depth;  // of the last picture
};

struct ulna_video {
  ulna::vision::VideoWriter writer;
};

struct ulna_mobilisation {
  ulna::sim::Mobilisation mobilisation;
};

struct ulna_viscoelastic {
  std::vector<ulna::Viscoelasticity> joints;
};

struct ulna_plant_difference {
  ulna::sim::Mobilisation done[2];  // full, reduced
  std::string joint;
  ulna::PlantOutcome full;
  ulna::PlantDifference difference;
};

struct ulna_body {
  std::shared_ptr<const ulna::BodyTree> tree;
};

struct ulna_sensors {
  std::shared_ptr<const ulna::SensorSuite> suite;
};

struct ulna_torques {
  ulna::BodyTorques torques;
};

struct ulna_torque_stream {
  std::unique_ptr<ulna::TorqueEstimator> closed;  // one of the two
  std::unique_ptr<ulna::MapEstimator> sparse;
  ulna::BodyState state;
  ulna::Vector measured;
};

namespace ulna::capi {
inline Token* token_of(ulna_token* handle) noexcept {
  return handle == nullptr ? nullptr : &handle->token;
}
}  // namespace ulna::capi
