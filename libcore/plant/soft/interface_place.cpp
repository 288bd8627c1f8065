#include "plant/soft/interface_place.hpp"

namespace ulna {

InterfacePlace::InterfacePlace(const SoftInterfaceOptions& o, const EngineModel& model)
    : link(model.at(Part::kBody, o.cuff.link)),
      bone(model.at(Part::kBody, o.bone)),
      cuff_position(o.cuff.position),
      cuff_orientation(o.cuff.orientation),
      centre(o.centre) {}

LimbPose InterfacePlace::pose(const EngineRun& run) const {
  const Matrix3 link_axes = run.body_orientation(link);
  const Matrix3 axes = link_axes * cuff_orientation;
  const Vector3 origin = run.body_position(link) + link_axes * cuff_position;
  return {axes.transpose() * (centre_in_world(run) - origin),
          axes.transpose() * run.body_orientation(bone)};
}

Vector3 InterfacePlace::centre_in_world(const EngineRun& run) const {
  return run.body_position(bone) + run.body_orientation(bone) * centre;
}

Matrix InterfacePlace::jacobian(const EngineRun& run) const {
  const Vector3 at = centre_in_world(run);
  const Matrix apart = run.point_jacobian(bone, at) - run.point_jacobian(link, at);
  const Matrix3 back = (run.body_orientation(link) * cuff_orientation).transpose();
  Matrix jacobian(6, apart.cols());
  jacobian.topRows<3>() = back * apart.topRows<3>();
  jacobian.bottomRows<3>() = back * apart.bottomRows<3>();
  return jacobian;
}

}  // namespace ulna
