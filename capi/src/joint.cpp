#include <ulna/joint.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "guard.hpp"
#include "handles.hpp"
#include "ident.hpp"
#include "impedance/joint.hpp"
#include "record/look.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

TwoLink arm_of(const ulna_arm* given) {
  const ulna_arm a = read_options(given, "arm");
  TwoLink out;
  if (a.upper_m != 0.0) out.upper_m = a.upper_m;
  if (a.fore_m != 0.0) out.fore_m = a.fore_m;
  out.shoulder_x_m = a.shoulder_m[0];
  out.shoulder_y_m = a.shoulder_m[1];
  out.left = a.left != 0;
  check_arm(out);
  return out;
}

Matrix optional_view(const ulna_view* view, const char* argument) {
  return view == nullptr ? Matrix() : Matrix(map_view(view, argument));
}

Matrix pairs(const ulna_view* view, const char* argument) {
  Matrix out = map_view(view, argument);
  require(out.cols() == 2, argument, std::string(argument) + " must have two columns");
  return out;
}

Vector stacked(const Matrix& m, const Matrix& b, const Matrix& k) {
  const Index n = m.rows();
  for (const Matrix* z : {&m, &b, &k}) {
    require(z->rows() == n && z->cols() == n, "m", "M, B and K must be square and of one size");
  }
  Vector out(3 * n * n);
  Index at = 0;
  for (const Matrix* z : {&m, &b, &k}) {
    for (Index i = 0; i < n; ++i, at += n) out.segment(at, n) = z->row(i).transpose();
  }
  return out;
}

Posture posture_request(const ulna_joint_request& r) {
  Posture out;
  const StridedMap jacobian = map_view(r.jacobian, "jacobian");
  require(
      jacobian.rows() >= 1 && jacobian.rows() <= 6 && jacobian.cols() >= 1 && jacobian.cols() <= 12,
      "jacobian", "the Jacobian must have from 1 to 6 rows and from 1 to 12 columns");
  out.jacobian = jacobian;
  const Matrix slopes = map_view(r.slope, "slope");
  const Index rows = out.jacobian.rows();
  const Index n = out.jacobian.cols();
  require(slopes.rows() == rows * n && slopes.cols() == n, "slope",
          "the derivatives of the Jacobian must stand one below the other, " +
              std::to_string(rows * n) + " x " + std::to_string(n));
  for (Index k = 0; k < n; ++k) out.slope.emplace_back(slopes.middleRows(k * rows, rows));
  return out;
}

std::vector<double> flat(const JointImpedance& z) {
  std::vector<double> out;
  for (const Matrix* matrix : {&z.m, &z.b, &z.k, &z.covariance, &z.gamma}) {
    for (Index i = 0; i < matrix->rows(); ++i) {
      for (Index j = 0; j < matrix->cols(); ++j) out.push_back((*matrix)(i, j));
    }
  }
  return out;
}

JointImpedance transformed(const ulna_joint_request& r) {
  const Posture posture = posture_request(r);
  const Vector natural = stacked(map_view(r.m, "m"), map_view(r.b, "b"), map_view(r.k, "k"));
  const Matrix covariance = optional_view(r.covariance, "covariance");
  Vector force = Vector::Zero(posture.jacobian.rows());
  if (r.force_n != nullptr) force = map_view(r.force_n, "force_n").reshaped();
  const Matrix spread = optional_view(r.force_covariance, "force_covariance");
  require(r.direction == ULNA_JOINT_FROM_ENDPOINT || r.direction == ULNA_JOINT_TO_ENDPOINT,
          "direction", "direction must be ULNA_JOINT_FROM_ENDPOINT or _TO_ENDPOINT");
  const Index side =
      r.direction == ULNA_JOINT_FROM_ENDPOINT ? posture.jacobian.rows() : posture.jacobian.cols();
  require(natural.size() == 3 * side * side, "m",
          "M, B and K must be " + std::to_string(side) + " x " + std::to_string(side) +
              " for this Jacobian");
  if (r.direction == ULNA_JOINT_FROM_ENDPOINT) {
    return to_joint(natural, covariance, posture, force, spread);
  }
  return to_endpoint(natural, covariance, posture, force, spread,
                     r.condition_limit == 0.0 ? 1e4 : r.condition_limit);
}

template <class Make>
void write_pairs(const Matrix& in, Make make, double* out, int64_t capacity, int64_t* out_count) {
  std::vector<double> values(static_cast<std::size_t>(2 * in.rows()));
  for (Index i = 0; i < in.rows(); ++i) {
    const Eigen::Vector2d pair = make(Eigen::Vector2d(in(i, 0), in(i, 1)), i);
    values[static_cast<std::size_t>(2 * i)] = pair[0];
    values[static_cast<std::size_t>(2 * i + 1)] = pair[1];
  }
  write_array(values.data(), 2 * in.rows(), out, capacity, out_count);
}

}  // namespace

ulna_status ulna_joint_transform(const ulna_joint_request* request, double* out_condition,
                                 double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    double& condition = deref(out_condition, "out_condition");
    const JointImpedance z = transformed(read_options(request, "request"));
    const std::vector<double> values = flat(z);
    write_array(values.data(), static_cast<int64_t>(values.size()), out, capacity, out_count);
    condition = z.condition;
  });
}

ulna_status ulna_joint_get_margins(const ulna_view* m, const ulna_view* b, const ulna_view* k,
                                   const ulna_view* covariance, double level, int64_t draws,
                                   int64_t seed, ulna_joint_margins* out_margins) {
  return guarded([&] {
    JointImpedance z;
    z.m = map_view(m, "m");
    z.b = map_view(b, "b");
    z.k = map_view(k, "k");
    require(stacked(z.m, z.b, z.k).allFinite(), "m", "M, B and K must be finite");
    z.covariance = optional_view(covariance, "covariance");
    const Index size = 3 * z.m.size();
    require(z.covariance.size() == 0 || (z.covariance.rows() == size &&
                                         z.covariance.cols() == size && z.covariance.allFinite()),
            "covariance", "the covariance must be finite, a row for each entry of M, B and K");
    const JointPassivity p =
        joint_passivity(z, level, draws == 0 ? 4000 : draws, static_cast<std::uint64_t>(seed));
    ulna_joint_margins margins = {};
    margins.m_min = p.value[0];
    margins.b_min = p.value[1];
    margins.k_min = p.value[2];
    std::copy_n(p.interval[0], 2, margins.m_interval);
    std::copy_n(p.interval[1], 2, margins.b_interval);
    std::copy_n(p.interval[2], 2, margins.k_interval);
    margins.probability = p.probability;
    write_result(out_margins, margins, "out_margins");
  });
}

ulna_status ulna_arm_hand(const ulna_arm* arm, const ulna_view* angles_rad, double* out,
                          int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const TwoLink links = arm_of(arm);
    write_pairs(
        pairs(angles_rad, "angles_rad"),
        [&](const Eigen::Vector2d& q, Index) { return hand_of(links, q); }, out, capacity,
        out_count);
  });
}

ulna_status ulna_arm_angles(const ulna_arm* arm, const ulna_view* hand_m, double* out,
                            int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const TwoLink links = arm_of(arm);
    const auto angles = [&](const Eigen::Vector2d& hand, Index row) {
      const std::string place = "row " + std::to_string(row);
      if (!hand.allFinite()) {
        throw Error(Fault::kData, "hand_m", "the hand has no place at " + place, place);
      }
      try {
        return angles_of(links, hand);
      } catch (const Error& error) {
        throw Error(error.fault(), "hand_m", place + ": " + error.what(), place);
      }
    };
    write_pairs(pairs(hand_m, "hand_m"), angles, out, capacity, out_count);
  });
}

ulna_status ulna_arm_posture(const ulna_arm* arm, const ulna_view* angles_rad, double* out,
                             int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Matrix q = map_view(angles_rad, "angles_rad");
    require(q.size() == 2, "angles_rad", "a posture has two angles");
    const Posture posture = posture_of(arm_of(arm), {q(0), q(1)});
    std::vector<double> values;
    for (const Matrix* j : {&posture.jacobian, &posture.slope[0], &posture.slope[1]}) {
      for (const Index i : {0, 1}) {
        for (const Index k : {0, 1}) values.push_back((*j)(i, k));
      }
    }
    write_array(values.data(), 12, out, capacity, out_count);
  });
}

ulna_status ulna_arm_angles_of_markers(const ulna_view* shoulder_m, const ulna_view* elbow_m,
                                       const ulna_view* wrist_m, double* out, int64_t capacity,
                                       int64_t* out_count) {
  return guarded([&] {
    const Matrix angles = angles_of_markers(pairs(shoulder_m, "shoulder_m"),
                                            pairs(elbow_m, "elbow_m"), pairs(wrist_m, "wrist_m"));
    write_pairs(
        angles, [](const Eigen::Vector2d& q, Index) { return q; }, out, capacity, out_count);
  });
}

ulna_status ulna_record_to_joints(const ulna_record* record, const ulna_arm* arm,
                                  const ulna_prepare_options* prepare, const ulna_view* angles_rad,
                                  double condition_limit, ulna_record** out_record) {
  return guarded([&] {
    const Record& source = deref(record, "record").record;
    ulna_record*& out = deref(out_record, "out_record");
    const PrepareRequest request = prepare_request(prepare);
    const Roles roles = find_roles(source, request.position, request.force, request.reference);
    Record result =
        joint_record(source, roles, arm_of(arm), optional_view(angles_rad, "angles_rad"),
                     condition_limit == 0.0 ? 1e3 : condition_limit);
    auto findings = look(result);
    out = std::make_unique<ulna_record>(
              ulna_record{std::move(result), std::move(findings), {}, false})
              .release();
  });
}
