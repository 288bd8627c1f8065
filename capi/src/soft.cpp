#include <ulna/soft.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "assessment.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "plant/soft/compression.hpp"
#include "plant/soft/reduced_plant.hpp"
#include "scene.hpp"
#include "signal/finite.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

constexpr Index kReportValues = 22;
constexpr Index kBushingValues = 86;

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

void read_interface(const ulna_soft_options& o, int which, SoftInterfaceOptions& i) {
  i.tissue.stiffness = or_default(o.stiffness_n_m[which], i.tissue.stiffness);
  i.tissue.viscosity = or_none(o.viscosity_n_s_m[which], i.tissue.viscosity);
  i.tissue.neighbour = or_none(o.neighbour[which], i.tissue.neighbour);
  i.tissue.volume = or_none(o.volume[which], i.tissue.volume);
  i.tissue.element_mass = or_default(o.element_mass_kg[which], i.tissue.element_mass);
  i.friction = or_none(o.friction[which], i.friction);
  i.shear = or_default(o.shear[which], i.shear);
  i.strap.pretension = or_none(o.pretension_n[which], i.strap.pretension);
  i.strap.length = o.strap_length_m[which];
  i.strap.stiffness = or_default(o.strap_stiffness_n_m[which], i.strap.stiffness);
  i.cuff.lined = !flag(o.unlined, "unlined");
  i.cuff.squeeze = or_none(o.squeeze_m[which], i.cuff.squeeze);
  i.cuff.tightness = or_none(o.tightness_pa[which], i.cuff.tightness);
}

SoftScene soft_of(const ExoScene& scene, const ulna_soft_options& o) {
  Donning donning;
  for (int k = 0; k < 3; ++k) {
    donning.shoulder_offset[k] = o.shoulder_offset_m[k];
    donning.elbow_offset[k] = o.elbow_offset_m[k];
  }
  donning.rotation = o.donning_rotation_rad;
  const auto design = kind_of<CuffDesign>(o.cuffs, 2, "cuffs");
  SoftScene soft = SoftScene::of(scene, donning, design);
  for (int which = 0; which < 2; ++which) {
    read_interface(o, which, soft.interfaces[static_cast<std::size_t>(which)]);
  }
  if (!flag(o.fixed_device, "fixed_device")) {
    const ArmDescription published = ArmDescription::cylinders();
    fit_device(soft, scene.arm.upper_scale / published.upper_scale,
               scene.arm.fore_scale / published.fore_scale);
  }
  return soft;
}

const SoftPlant& soft_of(const ulna_plant* handle) {
  const ulna_plant& plant = deref(handle, "plant");
  if (!plant.soft) {
    throw Error(Fault::kUnsupported, "plant", "the plant has no soft interfaces");
  }
  return *plant.soft;
}

void give_plant(ulna_plant** place, SoftPlant plant) {
  auto soft = std::make_shared<const SoftPlant>(std::move(plant));
  *place = new ulna_plant{soft->plant(), soft};
}

ReductionOptions reduction_of(const ulna_reduction_options* options) {
  const ulna_reduction_options o = read_options(options, "options");
  ReductionOptions r;
  r.start = or_default(o.start_rad, r.start);
  r.end = or_default(o.end_rad, r.end);
  // Too many are refused by name, whatever an int holds.
  if (o.poses != 0) r.poses = static_cast<int>(std::clamp<std::int64_t>(o.poses, -1, 1'000'000));
  r.activation = or_none(o.activation, r.activation);
  r.check();
  return r;
}

RowMajor rows_of_bushings(const std::vector<Bushing>& bushings) {
  RowMajor rows(static_cast<Index>(bushings.size()), kBushingValues);
  for (Index k = 0; k < rows.rows(); ++k) {
    const Bushing& b = bushings[static_cast<std::size_t>(k)];
    rows.row(k) << b.interface, b.strap ? 1.0 : 0.0, b.origin.transpose(), b.preload.transpose(),
        b.stiffness.reshaped().transpose(), b.damping.reshaped().transpose();
  }
  return rows;
}

RowMajor rows_of_reports(const std::vector<InterfaceReport>& reports, bool reduced) {
  RowMajor rows(static_cast<Index>(reports.size()), kReportValues);
  for (Index k = 0; k < rows.rows(); ++k) {
    const InterfaceReport& r = reports[static_cast<std::size_t>(k)];
    rows.row(k) << r.cuff.wrench.transpose(), r.strap.wrench.transpose(),
        r.displacement.transpose(), r.turn, r.sliding.transpose(),
        std::max(r.cuff.peak_pressure, r.strap.peak_pressure), r.cuff.area + r.strap.area,
        r.tension;
    if (reduced) rows.row(k).tail(6).setConstant(std::nan(""));
  }
  return rows;
}

}  // namespace

namespace ulna::capi {

SoftScene read_soft(const ExoScene& scene, const ulna_soft_options& options) {
  return soft_of(scene, options);
}

ReductionOptions read_reduction(const ulna_reduction_options* options) {
  return reduction_of(options);
}

}  // namespace ulna::capi

ulna_status ulna_plant_new_soft(const ulna_scene_options* scene, const ulna_soft_options* soft,
                                ulna_plant** out_plant) {
  return guarded([&] {
    deref(out_plant, "out_plant");
    SoftPlant plant(soft_of(scene_of(scene), read_options(soft, "soft")));
    EngineRun run(plant.model());
    // A limb that cannot be put in is refused here.
    plant.attach(run, device_reference(plant.description().scene));
    give_plant(out_plant, std::move(plant));
  });
}

ulna_status ulna_plant_reduce(const ulna_plant* plant, const ulna_reduction_options* options,
                              ulna_token* token, ulna_plant** out_plant) {
  return guarded([&] {
    deref(out_plant, "out_plant");
    const SoftPlant& full = soft_of(plant);
    give_plant(out_plant,
               full.reduced(reduce(full, reduction_of(options), token_of(token)).bushings));
  });
}

ulna_status ulna_plant_bushings(const ulna_plant* plant, double* out, int64_t capacity,
                                int64_t* out_count) {
  return guarded([&] {
    const ulna_plant& own = deref(plant, "plant");
    const RowMajor rows =
        rows_of_bushings(own.soft ? own.soft->bushings() : std::vector<Bushing>());
    write_array(rows.data(), rows.size(), out, capacity, out_count);
  });
}

ulna_status ulna_run_don(ulna_run* run, const ulna_view* device_angle) {
  return guarded([&] {
    ulna_run& own = deref(run, "run");
    if (!own.soft) {
      throw Error(Fault::kUnsupported, "run", "the run's plant has no soft interfaces");
    }
    const Vector angle = entries_of(device_angle, "device_angle");
    require_finite(angle, "device_angle");
    own.soft->attach(own.run, angle);
  });
}

ulna_status ulna_run_interfaces(ulna_run* run, double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const ulna_run& own = deref(run, "run");
    const RowMajor rows =
        rows_of_reports(interface_reports(own.run), own.soft && own.soft->is_reduced());
    write_array(rows.data(), rows.size(), out, capacity, out_count);
  });
}

ulna_status ulna_tissue_compress(const ulna_soft_options* soft, int32_t which,
                                 double largest_strain, ulna_token* token, double* out,
                                 int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const int limb = kind_of<int>(which, 2, "which");
    const SoftScene scene = soft_of(ExoScene{}, read_options(soft, "soft"));
    CompressionOptions options;
    options.largest_strain = or_default(largest_strain, options.largest_strain);
    const CompressionResult r = compress(
        Tissue(scene.interfaces[static_cast<std::size_t>(limb)].tissue), options, token_of(token));
    RowMajor rows(r.force.size(), 5);
    rows << r.force, r.strain, r.stress, r.modulus, r.energy;
    write_array(rows.data(), rows.size(), out, capacity, out_count);
  });
}
