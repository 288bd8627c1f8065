#include <ulna/batch.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "assessment.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "plant/engine_mobilised.hpp"
#include "plant/soft/reduced_plant.hpp"
#include "plant/soft/soft_mobilised.hpp"
#include "scene.hpp"
#include "sim/mobilisation_batch.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr Index kAssessed = 10;  // columns that an assessment fills

// What a factor may be.
enum class Allowed { kPositive, kNotNegative, kAny };

struct VariedFactor {
  const char* name;
  Allowed allowed;
  bool soft;    // a part of soft interfaces
  bool person;  // of an arm by height and mass; else of its segments where it is one of them
};

constexpr VariedFactor kVaried[ULNA_VARIED_COUNT] = {
    {"upper_factor", Allowed::kPositive, false, false},
    {"fore_factor", Allowed::kPositive, false, false},
    {"upper_mass_kg", Allowed::kPositive, false, false},
    {"fore_mass_kg", Allowed::kPositive, false, false},
    {"upper_stiffness_n_m", Allowed::kPositive, true, false},
    {"fore_stiffness_n_m", Allowed::kPositive, true, false},
    {"upper_viscosity_n_s_m", Allowed::kNotNegative, true, false},
    {"fore_viscosity_n_s_m", Allowed::kNotNegative, true, false},
    {"upper_friction", Allowed::kNotNegative, true, false},
    {"fore_friction", Allowed::kNotNegative, true, false},
    {"upper_pretension_n", Allowed::kNotNegative, true, false},
    {"fore_pretension_n", Allowed::kNotNegative, true, false},
    {"shoulder_offset_x_m", Allowed::kAny, true, false},
    {"shoulder_offset_y_m", Allowed::kAny, true, false},
    {"shoulder_offset_z_m", Allowed::kAny, true, false},
    {"elbow_offset_x_m", Allowed::kAny, true, false},
    {"elbow_offset_y_m", Allowed::kAny, true, false},
    {"elbow_offset_z_m", Allowed::kAny, true, false},
    {"donning_rotation_rad", Allowed::kAny, true, false},
    {"flexors", Allowed::kNotNegative, false, false},
    {"extensors", Allowed::kNotNegative, false, false},
    {"height_m", Allowed::kPositive, false, true},
    {"mass_kg", Allowed::kPositive, false, true},
};

void check_value(const VariedFactor& factor, double value) {
  const bool fine = factor.allowed == Allowed::kAny        ? true
                    : factor.allowed == Allowed::kPositive ? value > 0.0
                                                           : value >= 0.0;
  require(fine, factor.name,
          std::string(factor.name) + " is " + std::to_string(value) + ", it must " +
              (factor.allowed == Allowed::kPositive ? "be positive" : "not be negative"));
}

// Numbers of an arm before what is varied.
struct ArmNumbers {
  bool person = false;
  double segments[4] = {1.0, 1.0, 1.761, 0.962};
  double height = 0.0, mass = 0.0;
};

ArmNumbers numbers_of(const ulna_scene_options* options) {
  const ulna_scene_options o = read_options(options, "scene");
  ArmNumbers n;
  n.person = o.height_m != 0.0 || o.mass_kg != 0.0;
  const double given[4] = {o.upper_factor, o.fore_factor, o.upper_mass_kg, o.fore_mass_kg};
  for (int k = 0; k < 4; ++k) n.segments[k] = or_default(given[k], n.segments[k]);
  n.height = o.height_m;
  n.mass = o.mass_kg;
  return n;
}

// 0 is none here, and a default to the options.
double none_or(double value) { return value == 0.0 ? -1.0 : value; }

}  // namespace

struct ulna_batch {
  ExoScene scene;
  ArmNumbers arm;
  std::optional<ulna_soft_options> soft;
  std::optional<ReductionOptions> reduction;
  std::optional<ExoScene> nominal;
  sim::Protocol protocol;
  ViscoelasticOptions estimator;
  std::vector<int> varied;
  std::vector<sim::BatchRow> results;
};

namespace {

ExoScene scene_of_row(const ulna_batch& batch, const Vector& row) {
  ArmNumbers n = batch.arm;
  bool changed = false;
  for (std::size_t k = 0; k < batch.varied.size(); ++k) {
    const double value = row[static_cast<Index>(k)];
    const int which = batch.varied[k];
    double* place = which <= ULNA_VARIED_FORE_MASS ? &n.segments[which]
                    : which == ULNA_VARIED_HEIGHT  ? &n.height
                    : which == ULNA_VARIED_MASS    ? &n.mass
                                                   : nullptr;
    if (place != nullptr) *place = value;
    changed = changed || place != nullptr;
  }
  ExoScene scene = batch.scene;
  if (!changed) return scene;
  const double* s = n.segments;
  ArmDescription arm = n.person ? ArmDescription::person(n.height, n.mass)
                                : ArmDescription::cylinders(s[0], s[1], s[2], s[3]);
  arm.pronation = scene.arm.pronation;
  arm.wrist = scene.arm.wrist;
  arm.muscles = scene.arm.muscles;
  scene.arm = std::move(arm);
  return scene;
}

ulna_soft_options soft_of_row(const ulna_batch& batch, const Vector& row) {
  ulna_soft_options o = *batch.soft;
  for (std::size_t k = 0; k < batch.varied.size(); ++k) {
    const double value = row[static_cast<Index>(k)];
    const int which = batch.varied[k];
    if (which >= ULNA_VARIED_UPPER_STIFFNESS && which <= ULNA_VARIED_FORE_PRETENSION) {
      double* const pairs[] = {o.stiffness_n_m, o.viscosity_n_s_m, o.friction, o.pretension_n};
      const int pair = which - ULNA_VARIED_UPPER_STIFFNESS;
      pairs[pair / 2][pair % 2] = none_or(value);
    } else if (which >= ULNA_VARIED_SHOULDER_OFFSET && which < ULNA_VARIED_ELBOW_OFFSET) {
      o.shoulder_offset_m[which - ULNA_VARIED_SHOULDER_OFFSET] = value;
    } else if (which >= ULNA_VARIED_ELBOW_OFFSET && which < ULNA_VARIED_DONNING_ROTATION) {
      o.elbow_offset_m[which - ULNA_VARIED_ELBOW_OFFSET] = value;
    } else if (which == ULNA_VARIED_DONNING_ROTATION) {
      o.donning_rotation_rad = value;
    }
  }
  return o;
}

std::shared_ptr<const MobilisedPlant> plant_of_row(const ulna_batch& batch, const Vector& row,
                                                   Token* token) {
  for (std::size_t k = 0; k < batch.varied.size(); ++k) {
    check_value(kVaried[batch.varied[k]], row[static_cast<Index>(k)]);
  }
  const ExoScene scene = scene_of_row(batch, row);
  const ExoScene* nominal = batch.nominal ? &*batch.nominal : nullptr;
  if (!batch.soft) return mobilised(ExoPlant(scene), nominal);
  const SoftScene soft = read_soft(scene, soft_of_row(batch, row));
  auto plant = std::make_shared<const SoftPlant>(soft);
  if (batch.reduction) {
    plant = std::make_shared<const SoftPlant>(
        plant->reduced(reduce(*plant, *batch.reduction, token).bushings));
  }
  return mobilised(std::move(plant), nominal);
}

sim::Protocol protocol_of_row(const ulna_batch& batch, const Vector& row) {
  sim::Protocol p = batch.protocol;
  for (std::size_t k = 0; k < batch.varied.size(); ++k) {
    const double value = row[static_cast<Index>(k)];
    if (batch.varied[k] == ULNA_VARIED_FLEXORS) p.excitation.flexors = value;
    if (batch.varied[k] == ULNA_VARIED_EXTENSORS) p.excitation.extensors = value;
  }
  return p;
}

Vector assess_row(const ulna_batch& batch, const MobilisedPlant& plant,
                  const sim::Mobilisation& done) {
  const Viscoelasticity v =
      identify_viscoelasticity(*done.record, plant.nominal(), batch.estimator).front();
  Vector values(kAssessed);
  values << v.k, v.d, v.k_error, v.d_error, v.truth.k, v.truth.d, v.truth.k_alone, v.residual_rms,
      v.r_squared, v.model_residual_rms;
  return values;
}

void read_varied(const ulna_batch_options& o, ulna_batch& batch) {
  require(o.varied_count >= 0 && (o.varied_count == 0 || o.varied != nullptr), "varied",
          "varied must be a list of ULNA_VARIED_ constants");
  for (int64_t k = 0; k < o.varied_count; ++k) {
    const int which = kind_of<int>(o.varied[k], ULNA_VARIED_COUNT, "varied");
    const VariedFactor& factor = kVaried[which];
    require(std::find(batch.varied.begin(), batch.varied.end(), which) == batch.varied.end(),
            "varied", std::string(factor.name) + " is varied twice");
    require(!factor.soft || batch.soft, "varied",
            std::string(factor.name) + " needs soft interfaces");
    require(!factor.person || batch.arm.person, "varied",
            std::string(factor.name) + " needs a scene with a height and a mass");
    require(which > ULNA_VARIED_FORE_MASS || !batch.arm.person, "varied",
            std::string(factor.name) + " is not a number of an arm by height and mass");
    batch.varied.push_back(which);
  }
}

std::unique_ptr<ulna_batch> batch_of(const ulna_batch_options* options) {
  const ulna_batch_options o = read_options(options, "options");
  auto batch = std::make_unique<ulna_batch>();
  batch->scene = scene_of(o.scene);
  batch->arm = numbers_of(o.scene);
  if (o.soft != nullptr) batch->soft = read_options(o.soft, "soft");
  require(o.reduction == nullptr || batch->soft, "reduction",
          "only soft interfaces can be reduced");
  if (o.reduction != nullptr) batch->reduction = read_reduction(o.reduction);
  if (o.nominal != nullptr) batch->nominal = read_description(*o.nominal);
  batch->protocol = read_protocol(o.protocol);
  batch->estimator = read_estimator(o.estimator);
  read_varied(o, *batch);
  // What cannot be in any row is refused here.
  if (!batch->soft) batch->protocol.check(*mobilised(ExoPlant(batch->scene)));
  return batch;
}

std::vector<sim::BatchRow> run_rows(const ulna_batch& batch, const Matrix& rows, int threads,
                                    Token* token) {
  const auto row = [&](Index i) { return Vector(rows.row(i).transpose()); };
  sim::BatchWork work;
  work.plant = [&](Index i, Token* part) { return plant_of_row(batch, row(i), part); };
  work.protocol = [&](Index i) { return protocol_of_row(batch, row(i)); };
  work.assess = [&](Index, const MobilisedPlant& plant, const sim::Mobilisation& done) {
    return assess_row(batch, plant, done);
  };
  work.values = kAssessed;
  return sim::mobilise_rows(rows.rows(), work, threads, token);
}

RowMajor table_of(const std::vector<sim::BatchRow>& results) {
  RowMajor out(static_cast<Index>(results.size()), ULNA_BATCH_COLUMNS);
  for (Index i = 0; i < out.rows(); ++i) {
    const sim::BatchRow& r = results[static_cast<std::size_t>(i)];
    out.row(i) << static_cast<double>(r.status), r.wall_s, r.start_s, r.largest_slip,
        r.values.transpose();
  }
  return out;
}

}  // namespace

ulna_status ulna_batch_new(const ulna_batch_options* options, ulna_batch** out_batch) {
  return guarded([&] {
    deref(out_batch, "out_batch");
    *out_batch = batch_of(options).release();
  });
}

void ulna_batch_free(ulna_batch* batch) { delete batch; }

ulna_status ulna_batch_run(ulna_batch* batch, const ulna_view* rows, int32_t threads,
                           ulna_token* token, double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    ulna_batch& own = deref(batch, "batch");
    const Matrix values = rows_of(rows, "rows", static_cast<Index>(own.varied.size()));
    require(threads >= 0, "threads", "threads must not be negative");
    const int64_t count = values.rows() * ULNA_BATCH_COLUMNS;
    // What does not fit is said before anything is run.
    if (out == nullptr || capacity < count) {
      write_array(nullptr, count, out, capacity, out_count);
      return;
    }
    own.results = run_rows(own, values, threads, token_of(token));
    const RowMajor table = table_of(own.results);
    write_array(table.data(), count, out, capacity, out_count);
  });
}

ulna_status ulna_batch_text(const ulna_batch* batch, int64_t row, char* out_text, int64_t capacity,
                            int64_t* out_size) {
  return guarded([&] {
    const std::vector<sim::BatchRow>& results = deref(batch, "batch").results;
    require(row >= 0 && row < static_cast<int64_t>(results.size()), "row",
            "the last run had " + std::to_string(results.size()) + " rows");
    write_text(results[static_cast<std::size_t>(row)].reason, out_text, capacity, out_size);
  });
}
