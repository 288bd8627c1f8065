#include <ulna/exo.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <string>
#include <vector>

#include "guard.hpp"
#include "handles.hpp"
#include "plant/arm_muscles.hpp"
#include "plant/muscle_fit.hpp"
#include "signal/finite.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr Index kLinkValues = 26;
constexpr int64_t kStepsBetweenLooks = 20;  // at the token: below 50 ms for the largest scenes

const ExoPlant& plant_of(const ulna_plant* handle) { return deref(handle, "plant").plant; }

const char* text_of(const char* text, const char* argument) { return &deref(text, argument); }

bool flag(int32_t value, const char* argument) {
  require(value == 0 || value == 1, argument, std::string(argument) + " must be 0 or 1");
  return value == 1;
}

template <class Kind>
Kind kind_of(int32_t value, int32_t count, const char* argument) {
  require(value >= 0 && value < count, argument,
          std::string(argument) + " is " + std::to_string(value) + ", it must be between 0 and " +
              std::to_string(count - 1));
  return static_cast<Kind>(value);
}

Vector entries_of(const ulna_view* view, const char* argument) {
  const StridedMap map = map_view(view, argument);
  require(map.cols() == 1 || map.rows() == 1, argument,
          std::string(argument) + " must have one row or one column");
  return Matrix(map).reshaped();
}

// rows x columns, finite, with as many rows as `rows` where that is not negative.
Matrix rows_of(const ulna_view* view, const char* argument, Index columns, Index rows = -1) {
  const Matrix m = map_view(view, argument);
  require(m.cols() == columns, argument,
          std::string(argument) + " has " + std::to_string(m.cols()) + " columns, " +
              std::to_string(columns) + " are expected");
  require(rows < 0 || m.rows() == rows, argument,
          std::string(argument) + " has " + std::to_string(m.rows()) + " rows, " +
              std::to_string(rows) + " are expected");
  require_finite(m, argument);
  return m;
}

void write_rows(const RowMajor& m, double* out, int64_t capacity, int64_t* out_count) {
  write_array(m.data(), m.size(), out, capacity, out_count);
}

void write_vector(const VectorRef& v, double* out, int64_t capacity, int64_t* out_count) {
  write_array(v.data(), v.size(), out, capacity, out_count);
}

// Descriptions ------------------------------------------------------------------------------------

std::string name_of(const ulna_scene_options& o, Index entry, const char* otherwise) {
  if (o.link_names == nullptr) return otherwise + std::to_string(entry / 2 + 1);
  const char* name = o.link_names[entry];
  return name == nullptr ? "" : name;
}

ExoLink link_of(const ulna_scene_options& o, const Vector& v, Index i) {
  ExoLink link;
  link.name = name_of(o, 2 * i, "Link");
  link.joint = name_of(o, 2 * i + 1, "J");
  link.position = v.segment<3>(0);
  const Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
  require(std::fabs(q.norm() - 1.0) < 1e-6, "links",
          "link '" + link.name + "' has a quaternion whose length is not 1");
  link.orientation = q.normalized().toRotationMatrix();
  link.axis = v.segment<3>(7);
  link.lower = v[10];
  link.upper = v[11];
  link.reference = v[12];
  link.mass = v[13];
  link.centre = v.segment<3>(14);
  std::copy_n(v.data() + 17, 6, link.inertia);
  link.damping = v[23];
  link.friction = v[24];
  link.motor_limit = v[25];
  return link;
}

ExoDescription exo_of(const ulna_scene_options& o) {
  ExoDescription exo = ExoDescription::published();
  if (o.links != nullptr) {
    const Matrix m = map_view(o.links, "links");
    require(m.cols() == kLinkValues && m.rows() >= 2, "links",
            "links must have 26 columns and two rows or more");
    require(o.link_names == nullptr || o.link_name_count == 2 * m.rows(), "link_names",
            "link_names must have two names for each link");
    exo.links.clear();
    exo.straps.clear();
    for (Index i = 0; i < m.rows(); ++i) {
      const Vector row = m.row(i).transpose();
      exo.links.push_back(link_of(o, row, i));
    }
    exo.name = "exoskeleton";
    exo.upper_link = exo.links[exo.links.size() - 2].name;
    exo.fore_link = exo.links.back().name;
  }
  if (flag(o.published_straps, "published_straps")) exo.use_published_straps();
  return exo;
}

std::vector<Muscle> muscles_of(const ulna_scene_options& o) {
  std::vector<Muscle> muscles;
  switch (kind_of<int>(o.muscles, 4, "muscles")) {
    case ULNA_MUSCLES_FITTED:
      muscles = fitted_elbow_muscles();
      break;
    case ULNA_MUSCLES_PUBLISHED:
      muscles = published_elbow_muscles();
      break;
    case ULNA_MUSCLES_UNFITTED:
      muscles = unfitted_elbow_muscles();
      break;
    default:
      break;
  }
  if (flag(o.shoulder_muscles, "shoulder_muscles")) {
    for (const Muscle& muscle : published_shoulder_muscles()) muscles.push_back(muscle);
  }
  if (o.muscle_values == nullptr) return muscles;
  const Matrix values =
      rows_of(o.muscle_values, "muscle_values", 3, static_cast<Index>(muscles.size()));
  for (std::size_t k = 0; k < muscles.size(); ++k) {
    const auto row = static_cast<Index>(k);
    muscles[k].force = values(row, 0);
    muscles[k].range[0] = values(row, 1);
    muscles[k].range[1] = values(row, 2);
  }
  return muscles;
}

double or_default(double value, double otherwise) { return value == 0.0 ? otherwise : value; }

ArmDescription arm_of(const ulna_scene_options& o) {
  const bool person = o.height_m != 0.0 || o.mass_kg != 0.0;
  const bool table = o.upper_factor != 0.0 || o.fore_factor != 0.0 || o.upper_mass_kg != 0.0 ||
                     o.fore_mass_kg != 0.0;
  require(!(person && table), "height_m",
          "an arm is given by height and mass or by factors and masses of its segments, not both");
  ArmDescription arm = person ? ArmDescription::person(o.height_m, o.mass_kg)
                              : ArmDescription::cylinders(or_default(o.upper_factor, 1.0),
                                                          or_default(o.fore_factor, 1.0),
                                                          or_default(o.upper_mass_kg, 1.761),
                                                          or_default(o.fore_mass_kg, 0.962));
  arm.pronation = flag(o.pronation, "pronation");
  arm.wrist = flag(o.wrist, "wrist");
  arm.muscles = muscles_of(o);
  return arm;
}

ExoScene scene_of(const ulna_scene_options* options) {
  const ulna_scene_options o = read_options(options, "options");
  ExoScene scene;
  scene.exo = exo_of(o);
  scene.arm = arm_of(o);
  scene.coupling = kind_of<Coupling>(o.coupling, 4, "coupling");
  scene.solver.elliptic = flag(o.elliptic, "elliptic");
  if (o.iterations != 0) scene.solver.iterations = o.iterations;
  scene.solver.timestep = or_default(o.timestep_s, scene.solver.timestep);
  scene.solver.tolerance = or_default(o.tolerance, scene.solver.tolerance);
  scene.solver.impratio = or_default(o.impratio, scene.solver.impratio);
  return scene;
}

// Runs --------------------------------------------------------------------------------------------

EngineRun::Out settable(EngineRun& run, int32_t field) {
  switch (field) {
    case ULNA_RUN_POSITION:
      return run.position();
    case ULNA_RUN_VELOCITY:
      return run.velocity();
    case ULNA_RUN_ACTIVATION:
      return run.activation();
    case ULNA_RUN_CONTROL:
      return run.control();
    case ULNA_RUN_APPLIED:
      return run.applied();
    default:
      break;
  }
  throw Error(Fault::kArgument, "field", "field " + std::to_string(field) + " cannot be set");
}

Vector field_of(EngineRun& run, int32_t field) {
  switch (field) {
    case ULNA_RUN_ACCELERATION:
      return run.acceleration();
    case ULNA_RUN_BIAS:
      return run.bias();
    case ULNA_RUN_PASSIVE:
      return run.passive();
    case ULNA_RUN_CONSTRAINT:
      return run.constraint_force();
    case ULNA_RUN_ACTUATOR_TORQUE:
      return run.actuator_torque();
    case ULNA_RUN_ACTUATOR_FORCE:
      return run.actuator_force();
    case ULNA_RUN_ACTUATOR_LENGTH:
      return run.actuator_length();
    case ULNA_RUN_TIME_AND_ENERGY:
      return Eigen::Vector3d(run.time(), run.potential_energy(), run.kinetic_energy());
    default:
      return settable(run, field);
  }
}

// One state after another through a run of its own.
template <class Make>
RowMajor each_pose(const ExoPlant& plant, const Matrix& angle, Index width, const Make& make) {
  EngineRun run(plant.model());
  RowMajor values(angle.rows(), width);
  for (Index i = 0; i < angle.rows(); ++i) {
    run.position() = angle.row(i).transpose();
    const Matrix made = make(run, i);
    values.row(i) = made.reshaped().transpose();
  }
  return values;
}

struct Motions {
  Matrix angle, rate, acceleration;
};

RowMajor inverse_dynamics(const ExoPlant& plant, int dynamics, const Motions& m) {
  const Index n = plant.model().velocities();
  if (dynamics == ULNA_DYNAMICS_ENGINE) {
    return each_pose(plant, m.angle, n, [&](EngineRun& run, Index i) {
      run.velocity() = m.rate.row(i).transpose();
      const Vector acceleration = m.acceleration.row(i).transpose();
      run.activation().setZero();
      // What actuators do at no excitation: muscles that are stretched resist.
      run.forward();
      const Vector muscles = run.actuator_torque();
      return Matrix(run.inverse(acceleration) - muscles);
    });
  }
  RowMajor torque(m.angle.rows(), n);
  for (Index i = 0; i < m.angle.rows(); ++i) {
    const Vector q = m.angle.row(i).transpose();
    const Vector v = m.rate.row(i).transpose();
    const Vector a = m.acceleration.row(i).transpose();
    torque.row(i) = plant.inverse_dynamics(q, v, a, dynamics == ULNA_DYNAMICS_FRICTION).transpose();
  }
  return torque;
}

RowMajor table_rows(const MuscleTable& t) {
  const Index width = t.length.cols();
  RowMajor rows(t.angle.size(), 4 * width);
  rows << t.length, t.moment, t.active, t.passive;
  return rows;
}

std::vector<std::string> names_of(const char* const* names, int64_t count, const char* argument) {
  require(count >= 0 && (count == 0 || names != nullptr), argument,
          std::string(argument) + " must be a list of names");
  std::vector<std::string> list;
  for (int64_t i = 0; i < count; ++i) list.emplace_back(text_of(names[i], argument));
  return list;
}

// The fit of a plant's elbow muscles, one row each: force and range.
RowMajor fit_of(const ExoPlant& plant, double passive_limit, int64_t evaluations, Token* token) {
  ExoScene scene = plant.scene();
  scene.coupling = Coupling::kArmOnly;
  std::erase_if(scene.arm.muscles,
                [](const Muscle& m) { return m.group == MuscleGroup::kShoulder; });
  require(!scene.arm.muscles.empty(), "plant", "the plant has no elbow muscles to fit");
  MuscleFitOptions options;
  if (passive_limit != 0.0) options.passive_limit = passive_limit;
  require(evaluations >= 0 && evaluations <= 100'000'000, "evaluations",
          "evaluations must be between 0 and 100 million");
  if (evaluations != 0) options.evaluations = static_cast<int>(evaluations);
  const MuscleFit fit = fit_muscles(elbow_table(scene, token), scene.arm.muscles, options, token);
  RowMajor values(static_cast<Index>(fit.muscles.size()), 3);
  for (Index k = 0; k < values.rows(); ++k) {
    const Muscle& m = fit.muscles[static_cast<std::size_t>(k)];
    values.row(k) << m.force, m.range[0], m.range[1];
  }
  return values;
}

}  // namespace

ulna_status ulna_plant_new(const ulna_scene_options* options, ulna_plant** out_plant) {
  return guarded([&] {
    deref(out_plant, "out_plant");
    *out_plant = new ulna_plant{ExoPlant(scene_of(options))};
  });
}

ulna_status ulna_plant_read(const char* path, int64_t contacts, ulna_plant** out_plant) {
  return guarded([&] {
    deref(out_plant, "out_plant");
    EngineRoom room;
    if (contacts != 0) room.contacts = contacts;
    *out_plant = new ulna_plant{ExoPlant::from_file(text_of(path, "path"), room)};
  });
}

ulna_status ulna_plant_change(const ulna_plant* plant, int32_t quantity, const char* name,
                              const ulna_view* values, ulna_plant** out_plant) {
  return guarded([&] {
    deref(out_plant, "out_plant");
    const Vector v = entries_of(values, "values");
    const Change change{kind_of<ModelQuantity>(quantity, 10, "quantity"), text_of(name, "name"),
                        std::vector<double>(v.data(), v.data() + v.size())};
    *out_plant = new ulna_plant{plant_of(plant).changed({change})};
  });
}

void ulna_plant_free(ulna_plant* plant) { delete plant; }

ulna_status ulna_plant_text(const ulna_plant* plant, char* out_text, int64_t capacity,
                            int64_t* out_size) {
  return guarded([&] { write_text(plant_of(plant).text(), out_text, capacity, out_size); });
}

ulna_status ulna_plant_names(const ulna_plant* plant, int32_t part, char* out_text,
                             int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const EngineModel& model = plant_of(plant).model();
    const Part kind = kind_of<Part>(part, 7, "part");
    std::string names;
    for (Index i = 0; i < model.count(kind); ++i) names += model.name(kind, i) + "\n";
    write_text(names, out_text, capacity, out_size);
  });
}

ulna_status ulna_plant_values(const ulna_plant* plant, int32_t quantity, const char* name,
                              double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const std::vector<double> values = plant_of(plant).model().values(
        kind_of<ModelQuantity>(quantity, 10, "quantity"), text_of(name, "name"));
    write_array(values.data(), static_cast<int64_t>(values.size()), out, capacity, out_count);
  });
}

ulna_status ulna_plant_reference(const ulna_plant* plant, double* out, int64_t capacity,
                                 int64_t* out_count) {
  return guarded(
      [&] { write_vector(plant_of(plant).model().reference(), out, capacity, out_count); });
}

ulna_status ulna_plant_range(const ulna_plant* plant, double* out, int64_t capacity,
                             int64_t* out_count) {
  return guarded(
      [&] { write_rows(plant_of(plant).model().joint_range(), out, capacity, out_count); });
}

ulna_status ulna_plant_check_start(const ulna_plant* plant, const ulna_view* start) {
  return guarded([&] { plant_of(plant).check_start(entries_of(start, "start")); });
}

ulna_status ulna_plant_inertia(const ulna_plant* plant, const ulna_view* angle, double* out,
                               int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const ExoPlant& p = plant_of(plant);
    const Matrix poses = rows_of(angle, "angle", p.model().positions());
    const Index n = p.model().velocities();
    write_rows(each_pose(p, poses, n * n,
                         [](EngineRun& run, Index) {
                           run.forward();
                           return run.inertia();
                         }),
               out, capacity, out_count);
  });
}

ulna_status ulna_plant_inverse_dynamics(const ulna_plant* plant, int32_t dynamics,
                                        const ulna_view* angle, const ulna_view* rate,
                                        const ulna_view* acceleration, double* out,
                                        int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const ExoPlant& p = plant_of(plant);
    const Index n = p.model().velocities();
    const int kind = kind_of<int>(dynamics, 3, "dynamics");
    const Matrix q = rows_of(angle, "angle", p.model().positions());
    const Motions motions{q, rows_of(rate, "rate", n, q.rows()),
                          rows_of(acceleration, "acceleration", n, q.rows())};
    write_rows(inverse_dynamics(p, kind, motions), out, capacity, out_count);
  });
}

ulna_status ulna_plant_muscles(const ulna_plant* plant, const char* joint,
                               const char* const* muscles, int64_t muscle_count,
                               const ulna_view* angle, const ulna_view* pose, ulna_token* token,
                               double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Vector still = pose == nullptr ? Vector() : entries_of(pose, "pose");
    const MuscleTable table = muscle_table(plant_of(plant).model(), text_of(joint, "joint"),
                                           names_of(muscles, muscle_count, "muscles"),
                                           entries_of(angle, "angle"), still, token_of(token));
    write_rows(table_rows(table), out, capacity, out_count);
  });
}

ulna_status ulna_plant_fit_muscles(const ulna_plant* plant, double passive_limit_nm,
                                   int64_t evaluations, ulna_token* token, double* out,
                                   int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    write_rows(fit_of(plant_of(plant), passive_limit_nm, evaluations, token_of(token)), out,
               capacity, out_count);
  });
}

ulna_status ulna_run_new(const ulna_plant* plant, ulna_run** out_run) {
  return guarded([&] {
    deref(out_run, "out_run");
    *out_run = new ulna_run{EngineRun(plant_of(plant).model())};
  });
}

void ulna_run_free(ulna_run* run) { delete run; }

ulna_status ulna_run_reset(ulna_run* run) {
  return guarded([&] { deref(run, "run").run.reset(); });
}

ulna_status ulna_run_set(ulna_run* run, int32_t field, const ulna_view* values) {
  return guarded([&] {
    EngineRun::Out target = settable(deref(run, "run").run, field);
    const Vector v = entries_of(values, "values");
    require(v.size() == target.size(), "values",
            "values has " + std::to_string(v.size()) + " entries, " +
                std::to_string(target.size()) + " are expected");
    require_finite(v, "values");
    target = v;
  });
}

ulna_status ulna_run_get(const ulna_run* run, int32_t field, double* out, int64_t capacity,
                         int64_t* out_count) {
  return guarded([&] {
    // Reading changes nothing; the engine's own interface has no const data.
    EngineRun& r = const_cast<ulna_run&>(deref(run, "run")).run;
    write_vector(field_of(r, field), out, capacity, out_count);
  });
}

ulna_status ulna_run_forward(ulna_run* run) {
  return guarded([&] { deref(run, "run").run.forward(); });
}

ulna_status ulna_run_step(ulna_run* run, int64_t steps, ulna_token* token) {
  return guarded([&] {
    EngineRun& r = deref(run, "run").run;
    require(steps >= 0, "steps", "steps must not be negative");
    for (int64_t done = 0; done < steps; done += kStepsBetweenLooks) {
      step(token_of(token), static_cast<double>(done) / static_cast<double>(steps));
      r.step(std::min(kStepsBetweenLooks, steps - done));
    }
    step(token_of(token), 1.0);
  });
}
