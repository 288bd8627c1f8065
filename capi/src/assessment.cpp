#include <ulna/assessment.h>

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "assessment.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "plant/engine_mobilised.hpp"
#include "plant/soft/soft_mobilised.hpp"
#include "record/look.hpp"
#include "signal/finite.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

using sim::ExcitationKind;
using sim::MotionShape;
using sim::Protocol;
using sim::TorqueUpdate;

TorqueUpdate update_of(int32_t torque) {
  switch (kind_of<int>(torque, 3, "torque")) {
    case ULNA_TORQUE_EVERY_STEP:
      return TorqueUpdate::kEveryStep;
    case ULNA_TORQUE_HELD:
      return TorqueUpdate::kHeld;
    default:
      return TorqueUpdate::kImplicitDamping;
  }
}

NominalFriction friction_of(int32_t friction) {
  switch (kind_of<int>(friction, 3, "friction")) {
    case ULNA_FRICTION_COULOMB:
      return NominalFriction::kCoulomb;
    case ULNA_FRICTION_NONE:
      return NominalFriction::kNone;
    default:
      return NominalFriction::kEngine;
  }
}

void read_moved(const ulna_protocol& o, Protocol& p) {
  const std::vector<std::string> names = name_list(o.moved, o.moved_count, "moved");
  const double end = p.motion.shape == MotionShape::kLogistic ? 0.0 : 10.0 * kDegree;
  Vector ends = Vector::Constant(static_cast<Index>(names.size()), end);
  if (o.end_rad != nullptr) ends = entries_of(o.end_rad, "end_rad");
  require(ends.size() == static_cast<Index>(names.size()), "end_rad",
          "there are " + std::to_string(ends.size()) + " ends for " + std::to_string(names.size()) +
              " joints that move");
  for (std::size_t i = 0; i < names.size(); ++i) {
    p.moved.push_back({names[i], ends[static_cast<Index>(i)]});
  }
}

void read_motion(const ulna_protocol& o, sim::ReferenceMotion& m) {
  m.shape = kind_of<MotionShape>(o.shape, 4, "shape");
  m.duration_s = or_default(o.duration_s, m.duration_s);
  m.rest_s = o.rest_s;
  if (o.repeats != 0) m.repeats = o.repeats;
  if (o.speeds == nullptr) return;
  const Vector speeds = entries_of(o.speeds, "speeds");
  m.speeds.assign(speeds.data(), speeds.data() + speeds.size());
}

void read_excitation(const ulna_protocol& o, sim::ExcitationModel& e) {
  e.kind = kind_of<ExcitationKind>(o.excitation, 3, "excitation");
  e.flexors = or_none(o.flexors, e.flexors);
  e.extensors = or_none(o.extensors, e.extensors);
  e.shoulder = o.shoulder;
  e.balanced = flag(o.balanced, "balanced");
  e.rate_gain = or_none(o.rate_gain_s, e.rate_gain);
  e.rate_threshold = or_none(o.rate_threshold_1_s, e.rate_threshold);
  e.length_gain = o.length_gain;
  e.length_threshold = or_default(o.length_threshold, e.length_threshold);
  e.delay_s = or_none(o.delay_s, e.delay_s);
}

void read_limits(const ulna_protocol& o, Protocol& p) {
  p.settle_s = or_none(o.settle_s, p.donned ? p.settle_s : Protocol::published().settle_s);
  p.approach_s = o.approach_s;
  p.start_limit_s = or_default(o.start_limit_s, p.start_limit_s);
  p.start_angle = or_default(o.start_angle_rad, p.start_angle);
  p.start_rate = or_default(o.start_rate_rad_s, p.start_rate);
  p.log_rate_hz = or_default(o.log_rate_hz, p.log_rate_hz);
  p.rate_limit = or_default(o.rate_limit_rad_s, p.rate_limit);
  p.follow_limit = or_default(o.follow_limit_rad, p.follow_limit);
  p.limit_margin = o.limit_margin_rad;
  p.time_limit_s = o.time_limit_s;
  p.published_flags = flag(o.published_flags, "published_flags");
}

Protocol protocol_of(const ulna_protocol* options) {
  const ulna_protocol o = read_options(options, "protocol");
  Protocol p;
  read_motion(o, p.motion);
  read_moved(o, p);
  if (o.start_rad != nullptr) p.start = entries_of(o.start_rad, "start_rad");
  p.donned = !flag(o.from_reference, "from_reference");
  p.control.mode = update_of(o.torque);
  p.control.weight = flag(o.carry_weight, "carry_weight");
  p.control.kp = or_none(o.kp, p.control.kp);
  p.control.ki = or_none(o.ki, p.control.ki);
  p.control.kd = or_none(o.kd, p.control.kd);
  p.control.hold_s = or_default(o.hold_s, p.control.hold_s);
  p.control.reference_hold_s = o.reference_hold_s;
  read_excitation(o, p.excitation);
  read_limits(o, p);
  return p;
}

const ExoScene& description_of(const ulna_plant& handle) {
  if (handle.published) {
    throw Error(Fault::kUnsupported, "nominal",
                "the published simulation cannot be the nominal model of another plant");
  }
  return handle.soft ? handle.soft->description().scene : handle.plant.scene();
}

std::shared_ptr<const MobilisedPlant> plant_of(const ulna_plant* plant, const ulna_plant* nominal) {
  const ulna_plant& own = deref(plant, "plant");
  const ExoScene* scene = nominal == nullptr ? nullptr : &description_of(*nominal);
  if (own.published) return mobilised(own.published, scene);
  return own.soft ? mobilised(own.soft, scene) : mobilised(own.plant, scene);
}

NominalModel nominal_of(const ulna_plant* plant, const ulna_plant* nominal) {
  const ulna_plant& own = deref(plant, "plant");
  if (own.published && nominal == nullptr) return *own.published->nominal();
  return {description_of(nominal == nullptr ? own : *nominal), own.plant.model()};
}

void give_record(ulna_record** place, Record record) {
  std::vector<Finding> findings = look(record);
  deref(place, "out_record");
  *place = new ulna_record{std::move(record), std::move(findings), {}, false};
}

std::string lines_of(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& sentence : sentences) text += sentence + "\n";
  return text;
}

ViscoelasticOptions estimator_of(const ulna_viscoelastic_options* options) {
  const ulna_viscoelastic_options o = read_options(options, "options");
  ViscoelasticOptions v;
  v.joints = name_list(o.joints, o.joint_count, "joints");
  v.terms.friction = friction_of(o.friction);
  v.terms.damping = !flag(o.no_damping_torque, "no_damping_torque");
  v.terms.inertia = !flag(o.no_inertia, "no_inertia");
  v.human_angle = flag(o.human_angle, "human_angle");
  v.intercept = !flag(o.no_intercept, "no_intercept");
  v.damping = !flag(o.no_rate, "no_rate");
  v.errors = kind_of<ErrorModel>(o.errors, 2, "errors");
  v.hac_lag_s = or_default(o.hac_lag_s, v.hac_lag_s);
  v.block_s = or_default(o.block_s, v.block_s);
  if (o.bootstrap != 0) v.bootstrap = o.bootstrap;
  v.level = or_default(o.level, v.level);
  v.seed = static_cast<std::uint64_t>(o.seed);
  return v;
}

ParityOptions parity_of(const ulna_published_options* options) {
  const ulna_published_options o = read_options(options, "options");
  ParityOptions p;
  p.upper_factor = or_default(o.upper_factor, p.upper_factor);
  p.fore_factor = or_default(o.fore_factor, p.fore_factor);
  p.upper_mass = or_default(o.upper_mass_kg, p.upper_mass);
  p.fore_mass = or_default(o.fore_mass_kg, p.fore_mass);
  p.upper_stiffness = or_default(o.upper_stiffness_1_s2, p.upper_stiffness);
  p.fore_stiffness = or_default(o.fore_stiffness_1_s2, p.fore_stiffness);
  p.viscosity = or_default(o.viscosity_1_s, p.viscosity);
  p.defects.strap_mask = !flag(o.own_straps, "own_straps");
  p.defects.nominal_omissions = !flag(o.whole_nominal, "whole_nominal");
  p.defects.self_contact = !flag(o.no_self_contact, "no_self_contact");
  p.defects.tight_limits = !flag(o.wide_limits, "wide_limits");
  return p;
}

const Viscoelasticity& joint_at(const ulna_viscoelastic* handle, int64_t joint) {
  const std::vector<Viscoelasticity>& joints = deref(handle, "viscoelastic").joints;
  require(joint >= 0 && joint < static_cast<int64_t>(joints.size()), "joint",
          "joint must be between 0 and " + std::to_string(joints.size() - 1));
  return joints[static_cast<std::size_t>(joint)];
}

ulna_viscoelastic_joint numbers_of(const Viscoelasticity& v) {
  ulna_viscoelastic_joint r{};
  r.rows = v.rows;
  r.k = v.k;
  r.d = v.d;
  r.offset = v.offset;
  r.k_error = v.k_error;
  r.d_error = v.d_error;
  r.k_misfit_error = v.k_misfit_error;
  r.d_misfit_error = v.d_misfit_error;
  for (int i = 0; i < 2; ++i) {
    r.k_interval[i] = v.k_interval[i];
    r.d_interval[i] = v.d_interval[i];
    r.k_misfit_interval[i] = v.k_misfit_interval[i];
    r.d_misfit_interval[i] = v.d_misfit_interval[i];
  }
  r.level = v.level;
  r.r_squared = v.r_squared;
  r.residual_rms = v.residual_rms;
  r.noise_rms = v.noise_rms;
  r.condition = v.condition;
  r.true_k = v.truth.k;
  r.true_d = v.truth.d;
  r.true_k_alone = v.truth.k_alone;
  r.model_residual_rms = v.model_residual_rms;
  r.model_residual_max = v.model_residual_max;
  return r;
}

// rows x columns, finite.
Matrix state_rows(const ulna_view* view, const char* argument, Index rows, std::size_t columns) {
  const Matrix m = map_view(view, argument);
  require(m.rows() == rows && m.cols() == static_cast<Index>(columns), argument,
          std::string(argument) + " is " + std::to_string(m.rows()) + " x " +
              std::to_string(m.cols()) + ", expected " + std::to_string(rows) + " x " +
              std::to_string(columns));
  require_finite(m, argument);
  return m;
}

// K and D of every row, each row by row.
std::vector<double> impedance_rows(const MobilisedPlant& plant, const Matrix& angle,
                                   const Matrix& rate, const Matrix& activation, Token* token) {
  const std::unique_ptr<MuscleProbe> probe = plant.probe();
  std::vector<double> values;
  for (Index i = 0; i < angle.rows(); ++i) {
    step(token, static_cast<double>(i) / static_cast<double>(angle.rows()));
    const Vector q = angle.row(i).transpose();
    const Vector v = rate.row(i).transpose();
    const Vector a = activation.row(i).transpose();
    const sim::LocalImpedance local = sim::local_impedance(*probe, q, v, a);
    for (const Matrix* m : {&local.k, &local.d}) {
      for (Index r = 0; r < m->rows(); ++r) {
        for (Index c = 0; c < m->cols(); ++c) values.push_back((*m)(r, c));
      }
    }
  }
  return values;
}

}  // namespace

ulna_status ulna_plant_new_published(const ulna_published_options* options,
                                     ulna_plant** out_plant) {
  return guarded([&] {
    deref(out_plant, "out_plant");
    auto plant = std::make_shared<const ParityPlant>(parity_of(options));
    *out_plant = new ulna_plant{plant->plant(), nullptr, plant};
  });
}

namespace ulna::capi {

Protocol read_protocol(const ulna_protocol* options) { return protocol_of(options); }

ViscoelasticOptions read_estimator(const ulna_viscoelastic_options* options) {
  return estimator_of(options);
}

const ExoScene& read_description(const ulna_plant& plant) { return description_of(plant); }

void give_log(ulna_record** place, const sim::Mobilisation& mobilisation) {
  if (!mobilisation.record) {
    throw Error(Fault::kData, "mobilisation",
                "there is no record, because the movement did not begin: " + mobilisation.reason);
  }
  give_record(place, *mobilisation.record);
}

}  // namespace ulna::capi

ulna_status ulna_mobilisation_new(const ulna_plant* plant, const ulna_plant* nominal,
                                  const ulna_protocol* protocol, ulna_token* token,
                                  ulna_mobilisation** out_mobilisation) {
  return guarded([&] {
    deref(out_mobilisation, "out_mobilisation");
    const Protocol p = protocol_of(protocol);
    *out_mobilisation =
        new ulna_mobilisation{sim::mobilise(*plant_of(plant, nominal), p, token_of(token))};
  });
}

void ulna_mobilisation_free(ulna_mobilisation* mobilisation) { delete mobilisation; }

ulna_status ulna_mobilisation_get_result(const ulna_mobilisation* mobilisation,
                                         ulna_mobilisation_result* out_result) {
  return guarded([&] {
    const sim::Mobilisation& m = deref(mobilisation, "mobilisation").mobilisation;
    ulna_mobilisation_result r{};
    r.status = static_cast<int32_t>(m.status);
    r.rows = m.record ? m.record->rows() : 0;
    r.saturated_rows = m.saturated_rows;
    r.simulated_s = m.simulated_s;
    r.start_s = m.start_s;
    r.largest_slip_rad = m.largest_slip;
    write_result(out_result, r, "out_result");
  });
}

ulna_status ulna_mobilisation_text(const ulna_mobilisation* mobilisation, int32_t what,
                                   char* out_text, int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const sim::Mobilisation& m = deref(mobilisation, "mobilisation").mobilisation;
    const bool notes = kind_of<int>(what, 2, "what") == ULNA_MOBILISATION_NOTES;
    write_text(notes ? lines_of(m.notes) : m.reason, out_text, capacity, out_size);
  });
}

ulna_status ulna_mobilisation_record(const ulna_mobilisation* mobilisation,
                                     ulna_record** out_record) {
  return guarded([&] { give_log(out_record, deref(mobilisation, "mobilisation").mobilisation); });
}

ulna_status ulna_record_with_joint_errors(const ulna_record* record, const ulna_plant* plant,
                                          const ulna_plant* nominal,
                                          const ulna_joint_errors* errors,
                                          ulna_record** out_record) {
  return guarded([&] {
    const ulna_joint_errors o = read_options(errors, "errors");
    const sim::JointSensors sensors{o.angle_rad, o.rate_rad_s,     o.acceleration_rad_s2,
                                    o.torque_nm, o.slow_torque_nm, or_default(o.slow_hz, 0.5)};
    give_record(
        out_record,
        sim::with_errors(deref(record, "record").record, nominal_of(plant, nominal), sensors,
                         static_cast<std::uint64_t>(o.seed), static_cast<std::uint64_t>(o.run)));
  });
}

ulna_status ulna_viscoelastic_new(const ulna_record* record, const ulna_plant* plant,
                                  const ulna_plant* nominal,
                                  const ulna_viscoelastic_options* options, ulna_token* token,
                                  ulna_viscoelastic** out_viscoelastic) {
  return guarded([&] {
    deref(out_viscoelastic, "out_viscoelastic");
    *out_viscoelastic = new ulna_viscoelastic{
        identify_viscoelasticity(deref(record, "record").record, nominal_of(plant, nominal),
                                 estimator_of(options), token_of(token))};
  });
}

void ulna_viscoelastic_free(ulna_viscoelastic* viscoelastic) { delete viscoelastic; }

ulna_status ulna_viscoelastic_count(const ulna_viscoelastic* viscoelastic, int64_t* out_count) {
  return guarded([&] {
    deref(out_count, "out_count") =
        static_cast<int64_t>(deref(viscoelastic, "viscoelastic").joints.size());
  });
}

ulna_status ulna_viscoelastic_get_joint(const ulna_viscoelastic* viscoelastic, int64_t joint,
                                        ulna_viscoelastic_joint* out_joint) {
  return guarded(
      [&] { write_result(out_joint, numbers_of(joint_at(viscoelastic, joint)), "out_joint"); });
}

ulna_status ulna_viscoelastic_text(const ulna_viscoelastic* viscoelastic, int64_t joint,
                                   char* out_text, int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const Viscoelasticity& v = joint_at(viscoelastic, joint);
    write_text(v.joint + "\n" + lines_of(v.warnings), out_text, capacity, out_size);
  });
}

ulna_status ulna_plant_muscle_impedance(const ulna_plant* plant, const ulna_view* angle,
                                        const ulna_view* rate, const ulna_view* activation,
                                        ulna_token* token, double* out, int64_t capacity,
                                        int64_t* out_count) {
  return guarded([&] {
    const auto p = plant_of(plant, nullptr);
    const Index rows = map_view(angle, "angle").rows();
    const Matrix q = state_rows(angle, "angle", rows, p->human_joints().size());
    const Matrix v = state_rows(rate, "rate", rows, p->human_joints().size());
    const Matrix a = state_rows(activation, "activation", rows, p->muscles().size());
    const std::vector<double> values = impedance_rows(*p, q, v, a, token_of(token));
    write_array(values.data(), static_cast<int64_t>(values.size()), out, capacity, out_count);
  });
}
