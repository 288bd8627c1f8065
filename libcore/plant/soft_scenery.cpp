#include "plant/soft_scenery.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "signal/finite.hpp"

namespace ulna {
namespace {

constexpr Colour kTissue = {0.95F, 0.70F, 0.58F, 0.22F};
constexpr Colour kWebbing = {0.13F, 0.14F, 0.17F, 1.0F};
constexpr Colour kCuffForce = {0.00F, 0.52F, 0.40F, 1.0F};
constexpr Colour kStrapForce = {0.85F, 0.47F, 0.04F, 1.0F};

// From pale to dark red.
Colour pressure_colour(double share) {
  const auto s = static_cast<float>(std::clamp(share, 0.0, 1.0));
  return {0.96F - 0.30F * s, 0.80F - 0.74F * s, 0.66F - 0.58F * s, 1.0F};
}

struct InterfaceFrame {
  Vector3 cuff;       // origin in the world, m
  Matrix3 cuff_axes;  // columns, in the world
  Vector3 limb;       // the tissue's centre in the world, m
  Matrix3 limb_axes;
};

InterfaceFrame frame_of(const SoftInterfaceOptions& o, const EngineRun& run) {
  const Index link = run.model().at(Part::kBody, o.cuff.link);
  const Index bone = run.model().at(Part::kBody, o.bone);
  const Matrix3 axes = run.body_orientation(link);
  const Matrix3 bone_axes = run.body_orientation(bone);
  return {run.body_position(link) + axes * o.cuff.position, axes * o.cuff.orientation,
          run.body_position(bone) + bone_axes * o.centre, bone_axes};
}

// The tissue as it was, and a dot wherever the cuff presses on it.
void add_tissue(const TissueMesh& mesh, const InterfaceFrame& frame, const InterfaceRun* run,
                double full_pressure, std::vector<Shape>& shapes) {
  Shape whole{.kind = ShapeKind::kEllipsoid, .position = frame.limb};
  whole.orientation = frame.limb_axes;
  whole.size = mesh.semi_axes();
  whole.colour = kTissue;
  whole.framed = false;
  shapes.push_back(whole);
  if (run == nullptr) return;
  const Vector pressure = run->pressure();
  for (int i = 0; i < mesh.size(); ++i) {
    const double share = std::min(1.0, pressure[i] / full_pressure);
    if (share < 0.01) continue;
    Shape dot{.kind = ShapeKind::kEllipsoid};
    const Vector3 out = frame.limb_axes * mesh.direction(i);
    dot.position = frame.limb + (mesh.radius(i) + run->displacement()[i]) * out;
    dot.orientation = axes_along(out);
    dot.size = Vector3(0.003 + 0.003 * share, 0.003 + 0.003 * share, 0.002);
    dot.colour = pressure_colour(share);
    dot.framed = false;
    shapes.push_back(dot);
  }
}

// Points of a strap are its moving ones column by column, then those of either end.
void add_strap(const Strap& strap, const Matrix& points, const InterfaceFrame& frame,
               std::vector<Shape>& shapes) {
  const int along = strap.options().along;
  const int across = strap.options().across;
  const auto at = [&](int column, int row) {
    const int index = column == 0           ? strap.moving() + row
                      : column + 1 == along ? strap.moving() + across + row
                                            : (column - 1) * across + row;
    return Vector3(frame.cuff + frame.cuff_axes * points.col(index));
  };
  const auto add = [&](const Vector3& a, const Vector3& b, double radius) {
    shapes.push_back(bar(a, b, radius, kWebbing));
    shapes.back().framed = false;
  };
  for (int c = 0; c < along; ++c) {
    for (int r = 0; r < across; ++r) {
      if (c + 1 < along) add(at(c, r), at(c + 1, r), 0.0024);
      if (r + 1 < across) add(at(c, r), at(c, r + 1), 0.0018);
    }
  }
}

void add_force(const Vector3& at, const Vector3& force, double scale, const Colour& colour,
               std::vector<Shape>& shapes) {
  const Matrix point = at.transpose();
  const Matrix row = force.transpose();
  for (const Shape& arrow : force_arrows(point, row, scale, colour)) shapes.push_back(arrow);
}

// As rows of forces, of the run's own interfaces.
Matrix forces_of(const EngineRun& run) {
  const std::vector<InterfaceReport> reports = interface_reports(run);
  Matrix forces(static_cast<Index>(reports.size()), 6);
  for (Index i = 0; i < forces.rows(); ++i) {
    const InterfaceReport& r = reports[static_cast<std::size_t>(i)];
    forces.row(i) << r.cuff.wrench.head<3>().transpose(), r.strap.wrench.head<3>().transpose();
  }
  return forces;
}

}  // namespace

std::vector<Shape> interface_shapes(const SoftPlant& plant, const EngineRun& run,
                                    const InterfaceLook& look, const Matrix& forces) {
  const auto count = static_cast<Index>(plant.interfaces().size());
  const bool coupled = run.coupling() != nullptr;
  const Matrix drawn = forces.size() > 0 ? forces : forces_of(run);
  require(drawn.size() == 0 || (drawn.rows() == count && drawn.cols() == 6), "forces",
          "forces must have a row for each soft interface and six columns");
  require_finite(drawn, "forces");
  std::vector<Shape> shapes;
  for (Index i = 0; i < count; ++i) {
    const auto which = static_cast<std::size_t>(i);
    const SoftInterface& interface = *plant.interfaces()[which];
    const InterfaceFrame frame = frame_of(interface.options(), run);
    const bool full = coupled && !plant.is_reduced();
    const InterfaceRun* state = full ? &interface_run(run, which) : nullptr;
    if (look.tissue) {
      // Forces of a record come without the pressures that made them.
      const InterfaceRun* pressed = forces.size() > 0 ? nullptr : state;
      add_tissue(interface.tissue().mesh(), frame, pressed, look.full_pressure, shapes);
    }
    if (look.straps && state != nullptr) {
      add_strap(interface.strap(), state->strap_points(), frame, shapes);
    }
    if (!look.forces || drawn.size() == 0) continue;
    // Arrows end at the limb: the cuff's at its bottom, the strap's over the opening.
    const Vector3 up = frame.cuff_axes.col(1);
    const Vector3 cuff_force = frame.cuff_axes * drawn.row(i).head<3>().transpose();
    const Vector3 strap_force = frame.cuff_axes * drawn.row(i).tail<3>().transpose();
    const double wide = interface.tissue().mesh().semi_axes().tail<2>().mean();
    add_force(frame.limb - wide * up - look.force_scale * cuff_force, cuff_force, look.force_scale,
              kCuffForce, shapes);
    const Vector3 over =
        state == nullptr
            ? Vector3(frame.limb + wide * up)
            : Vector3(frame.cuff + frame.cuff_axes * state->strap_points().rowwise().mean());
    add_force(over - look.force_scale * strap_force, strap_force, look.force_scale, kStrapForce,
              shapes);
  }
  return shapes;
}

Scenery scenery_of(const SoftPlant& plant, ExoLookOptions options) {
  options.cuffs.emplace();
  for (const auto& interface : plant.interfaces()) {
    options.cuffs->push_back(interface->options().cuff);
  }
  ExoScene scene = plant.description().scene;
  scene.coupling = Coupling::kApart;  // the arm moves on its own joints, whatever the scene says
  return scenery_of(scene, options);
}

}  // namespace ulna
