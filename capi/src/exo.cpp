#include <ulna/exo.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "plant/muscle_fit.hpp"
#include "scene.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int64_t kStepsBetweenLooks = 20;  // at the token: below 50 ms for the largest scenes

const ExoPlant& plant_of(const ulna_plant* handle) { return deref(handle, "plant").plant; }

void write_rows(const RowMajor& m, double* out, int64_t capacity, int64_t* out_count) {
  write_array(m.data(), m.size(), out, capacity, out_count);
}

void write_vector(const VectorRef& v, double* out, int64_t capacity, int64_t* out_count) {
  write_array(v.data(), v.size(), out, capacity, out_count);
}

// Runs --------------------------------------------------------------------------------------------

// The reference, the arm donned where soft interfaces hold it.
void restart(ulna_run& run) {
  run.run.reset();
  if (run.soft) run.soft->attach(run.run, device_reference(run.soft->description().scene));
}

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
    const ulna_plant& own = deref(plant, "plant");
    if (own.soft) {
      throw Error(Fault::kUnsupported, "plant",
                  "numbers of a plant with soft interfaces follow from its description: describe "
                  "the changed one");
    }
    *out_plant = new ulna_plant{own.plant.changed({change})};
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
                                           name_list(muscles, muscle_count, "muscles"),
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
    const ulna_plant& own = deref(plant, "plant");
    auto run = std::make_unique<ulna_run>(ulna_run{EngineRun(own.plant.model()), own.soft});
    restart(*run);
    *out_run = run.release();
  });
}

void ulna_run_free(ulna_run* run) { delete run; }

ulna_status ulna_run_reset(ulna_run* run) {
  return guarded([&] { restart(deref(run, "run")); });
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
