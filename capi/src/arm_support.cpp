#include <ulna/arm_support.h>

#include <algorithm>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "guard.hpp"
#include "plant/arm_support.hpp"
#include "study.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

constexpr Index kPoseNumbers = 15;
constexpr Index kWrenchNumbers = 22;
constexpr Index kMostPoses = 1000000000;

SupportCurve support_curve(const ulna_view* view, const char* argument) {
  const Matrix table = rows_of(view, argument, 3);
  return {table.col(0), table.col(1), table.col(2)};
}

ArmSupport arm_support_of(const ulna_arm_support* given) {
  deref(given, "support");
  const ulna_arm_support s = read_options(given, "support");
  ArmSupport out;
  out.left = support_curve(s.left, "left");
  out.right = s.right == nullptr ? out.left : support_curve(s.right, "right");
  out.attachment = or_default(s.attachment, out.attachment);
  out.mass = or_none(s.mass_kg, out.mass);
  const Point3 up(s.up[0], s.up[1], s.up[2]);
  require(up.allFinite(), "up", "up must be a direction");
  if (up != Point3::Zero()) out.up = up.normalized();
  out.along_arm = flag(s.along_arm, "along_arm");
  check_support(out);
  return out;
}

Point3 point_at(const StridedMap& rows, Index row, Index column) {
  return {rows(row, column), rows(row, column + 1), rows(row, column + 2)};
}

SupportPose pose_at(const StridedMap& rows, Index row) {
  const SupportPose out = {{point_at(rows, row, 0), point_at(rows, row, 3)},
                           {point_at(rows, row, 6), point_at(rows, row, 9)},
                           point_at(rows, row, 12)};
  for (std::size_t side = 0; side < 2; ++side) {
    if (out.elbow[side] != out.shoulder[side]) continue;
    const std::string where = "row " + std::to_string(row);
    throw Error(Fault::kData, "poses",
                std::string("the ") + (side == 0 ? "left" : "right") +
                    " elbow lies in its shoulder at " + where + ": check the positions",
                where);
  }
  return out;
}

void put_wrenches(const SupportWrenches& w, double* out) {
  for (const Point3* p :
       {&w.force[0], &w.force[1], &w.point[0], &w.point[1], &w.hip_force, &w.hip_moment}) {
    out = std::copy(p->data(), p->data() + 3, out);
  }
  for (const double e : w.elevation) *out++ = e;
  for (const bool o : w.outside) *out++ = o ? 1.0 : 0.0;
}

StridedMap triples(const ulna_view* view, const char* argument) {
  const StridedMap map = map_view(view, argument);
  require(map.cols() == 3, argument, std::string(argument) + " must have 3 columns");
  return map;
}

}  // namespace

ulna_status ulna_arm_support_wrenches(const ulna_arm_support* support, const ulna_view* poses,
                                      double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const ArmSupport device = arm_support_of(support);
    const StridedMap rows = map_view(poses, "poses");
    require(rows.cols() == kPoseNumbers, "poses", "poses must have 15 columns: five points");
    require(rows.rows() <= kMostPoses, "poses", "poses must have at most 1e9 rows");
    if (study_count_only(kWrenchNumbers * rows.rows(), out, capacity, out_count)) return;
    // First to a buffer of our own: a failing call changes nothing.
    std::vector<double> all(static_cast<std::size_t>(kWrenchNumbers * rows.rows()));
    for (Index i = 0; i < rows.rows(); ++i) {
      put_wrenches(support_wrenches(device, pose_at(rows, i)), all.data() + kWrenchNumbers * i);
    }
    write_array(all.data(), static_cast<int64_t>(all.size()), out, capacity, out_count);
  });
}

ulna_status ulna_arm_elevation(const ulna_view* direction, const ulna_view* up, double* out,
                               int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const StridedMap arms = triples(direction, "direction");
    const StridedMap ups = triples(up, "up");
    require(ups.rows() == 1 || ups.rows() == arms.rows(), "up",
            "up must have 1 row, or one an arm");
    Vector all(arms.rows());
    for (Index i = 0; i < arms.rows(); ++i) {
      all[i] = arm_elevation(point_at(arms, i, 0), point_at(ups, ups.rows() == 1 ? 0 : i, 0));
    }
    write_array(all.data(), all.size(), out, capacity, out_count);
  });
}

ulna_status ulna_shoulder_zxy(const ulna_view* angles, double* out, int64_t capacity,
                              int64_t* out_count) {
  return guarded([&] {
    const StridedMap rows = triples(angles, "angles");
    Eigen::Matrix<double, 3, Eigen::Dynamic> all(3, rows.rows());
    for (Index i = 0; i < rows.rows(); ++i) all.col(i) = zxy_of_xyz(point_at(rows, i, 0));
    write_array(all.data(), all.size(), out, capacity, out_count);
  });
}
