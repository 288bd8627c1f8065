#include "scene.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "plant/arm_muscles.hpp"
#include "signal/finite.hpp"

namespace ulna::capi {
namespace {

constexpr Index kLinkValues = 26;

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
  const bool published_straps = flag(o.published_straps, "published_straps");
  if (o.links != nullptr) {
    require(!published_straps, "published_straps",
            "a device that is described by its links has no straps: leave published_straps out");
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
  if (published_straps) exo.use_published_straps();
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

}  // namespace

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

Vector device_reference(const ExoScene& scene) {
  Vector angle(static_cast<Index>(scene.exo.links.size()));
  for (Index j = 0; j < angle.size(); ++j) {
    angle[j] = scene.exo.links[static_cast<std::size_t>(j)].reference;
  }
  return angle;
}

}  // namespace ulna::capi
