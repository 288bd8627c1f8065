// Numbers changed in the compiled model: a copy, the new numbers, and what the engine's compiler
// derives from them.
#include <mujoco/mujoco.h>

#include <array>
#include <cmath>

#include "base/error.hpp"
#include "plant/engine/mjcf.hpp"
#include "plant/engine/model.hpp"
#include "plant/engine/trap.hpp"

namespace ulna {
namespace {

using engine::contained;

struct QuantityInfo {
  const char* word;
  Part part;
  std::size_t size;
};

QuantityInfo info_of(ModelQuantity quantity) {
  switch (quantity) {
    case ModelQuantity::kMass:
      return {"mass", Part::kBody, 1};
    case ModelQuantity::kInertia:
      return {"inertia", Part::kBody, 9};
    case ModelQuantity::kBodyPosition:
      return {"position", Part::kBody, 3};
    case ModelQuantity::kSitePosition:
      return {"position", Part::kSite, 3};
    case ModelQuantity::kJointDamping:
      return {"damping", Part::kJoint, 1};
    case ModelQuantity::kJointFriction:
      return {"friction", Part::kJoint, 1};
    case ModelQuantity::kLengthRange:
      return {"length range", Part::kActuator, 2};
    case ModelQuantity::kMuscle:
      return {"muscle", Part::kActuator, 3};
    case ModelQuantity::kReference:
      return {"reference", Part::kEquality, 2};
    case ModelQuantity::kImpedance:
      return {"impedance", Part::kEquality, 5};
  }
  throw Error(Fault::kArgument, "quantity", "quantity is none of those that can be changed");
}

class Checker {
 public:
  Checker(const Change& change, const QuantityInfo& info) : change_(change), info_(info) {}

  void that(bool condition, const std::string& what) const {
    if (condition) return;
    throw Error(Fault::kArgument, info_.word,
                std::string("the ") + info_.word + " of " + word(info_.part) + " '" + change_.name +
                    "' " + what,
                std::string(word(info_.part)) + " " + change_.name);
  }

 private:
  const Change& change_;
  const QuantityInfo& info_;
};

void check_moments(const double* moments, const Checker& check) {
  const double m[9] = {moments[0], moments[3], moments[4], moments[3], moments[1],
                       moments[5], moments[4], moments[5], moments[2]};
  double value[3];
  double vectors[9];
  double quaternion[4];
  mju_eig3(value, vectors, quaternion, m);  // sorted, the largest first
  check.that(value[2] > 0.0, "has a principal moment that is not positive");
  check.that(value[1] + value[2] >= value[0] * (1.0 - 1e-9),
             "breaks the triangle inequality of principal moments, so that no body has it");
}

void check_values(const Change& change, const QuantityInfo& info) {
  const Checker check(change, info);
  const std::vector<double>& v = change.values;
  check.that(v.size() == info.size,
             "takes " + std::to_string(info.size) + " numbers, not " + std::to_string(v.size()));
  for (const double x : v) check.that(std::isfinite(x), "holds a number that is not finite");
  switch (change.quantity) {
    case ModelQuantity::kMass:
      check.that(v[0] > 0.0, "must be positive");
      break;
    case ModelQuantity::kInertia:
      check_moments(v.data() + 3, check);
      break;
    case ModelQuantity::kJointDamping:
    case ModelQuantity::kJointFriction:
      check.that(v[0] >= 0.0, "must not be negative");
      break;
    case ModelQuantity::kLengthRange:
      check.that(0.0 < v[0] && v[0] < v[1], "must be two positive numbers, the shorter first");
      break;
    case ModelQuantity::kMuscle:
      check.that(v[0] > 0.0, "must have a positive peak force");
      check.that(0.0 <= v[1] && v[1] < v[2], "must have a range of two numbers, the shorter first");
      break;
    default:
      break;
  }
}

// What the compiler notes about a pose so that the engine can skip work where it is the identity.
mjtByte same_frame(const double* position, const double* quaternion) {
  const bool at_origin = position[0] == 0.0 && position[1] == 0.0 && position[2] == 0.0;
  const bool unturned =
      quaternion[0] == 1.0 && quaternion[1] == 0.0 && quaternion[2] == 0.0 && quaternion[3] == 0.0;
  return at_origin && unturned ? 1 : 0;
}

void set_inertia(mjModel& m, Index body, const double* values) {
  const double* c = values + 3;
  Eigen::Matrix3d inertia;
  inertia << c[0], c[3], c[4], c[3], c[1], c[5], c[4], c[5], c[2];
  PrincipalInertia principal = principal_inertia(inertia);
  mju_normalize4(principal.quaternion.data());  // as the compiler does with what it reads
  mju_copy3(m.body_ipos + 3 * body, values);
  mju_copy3(m.body_inertia + 3 * body, principal.moments.data());
  mju_copy4(m.body_iquat + 4 * body, principal.quaternion.data());
  m.body_sameframe[body] = same_frame(m.body_ipos + 3 * body, m.body_iquat + 4 * body);
}

void set_site(mjModel& m, Index site, const double* values) {
  mju_copy3(m.site_pos + 3 * site, values);
  m.site_sameframe[site] = same_frame(m.site_pos + 3 * site, m.site_quat + 4 * site);
}

void set_muscle(mjModel& m, Index actuator, const double* values) {
  // Gain and bias both hold range (2), peak force, ...; the engine's documented order.
  for (double* prm :
       {m.actuator_gainprm + mjNGAIN * actuator, m.actuator_biasprm + mjNBIAS * actuator}) {
    prm[0] = values[1];
    prm[1] = values[2];
    prm[2] = values[0];
  }
}

Index joint_velocity(const mjModel& m, Index joint, const Checker& check) {
  check.that(m.jnt_type[joint] == mjJNT_HINGE || m.jnt_type[joint] == mjJNT_SLIDE,
             "cannot be changed: the joint has more than one degree of freedom");
  return m.jnt_dofadr[joint];
}

void check_kind(const mjModel& m, const Change& change, Index i, const Checker& check) {
  const ModelQuantity q = change.quantity;
  if (q == ModelQuantity::kMuscle) {
    check.that(m.actuator_gaintype[i] == mjGAIN_MUSCLE && m.actuator_biastype[i] == mjBIAS_MUSCLE,
               "cannot be changed: the actuator is no muscle");
  }
  if (q == ModelQuantity::kMass || q == ModelQuantity::kInertia ||
      q == ModelQuantity::kBodyPosition) {
    check.that(i > 0, "cannot be changed: it is the world");
  }
  for (int e = 0; q == ModelQuantity::kBodyPosition && e < m.neq; ++e) {
    if (m.eq_type[e] != mjEQ_WELD) continue;
    throw Error(
        Fault::kUnsupported, "position",
        "the position of body '" + change.name +
            "' cannot be changed in a compiled scene with weld constraints, whose poses the "
            "compiler took from it: compile the scene again",
        "body " + change.name);
  }
}

void apply(mjModel& m, const Change& change, Index i, const Checker& check) {
  const double* v = change.values.data();
  check_kind(m, change, i, check);
  switch (change.quantity) {
    case ModelQuantity::kMass:
      m.body_mass[i] = v[0];
      break;
    case ModelQuantity::kInertia:
      set_inertia(m, i, v);
      break;
    case ModelQuantity::kBodyPosition:
      mju_copy3(m.body_pos + 3 * i, v);
      break;
    case ModelQuantity::kSitePosition:
      set_site(m, i, v);
      break;
    case ModelQuantity::kJointDamping:
      m.dof_damping[joint_velocity(m, i, check)] = v[0];
      break;
    case ModelQuantity::kJointFriction:
      m.dof_frictionloss[joint_velocity(m, i, check)] = v[0];
      break;
    case ModelQuantity::kLengthRange:
      mju_copy(m.actuator_lengthrange + 2 * i, v, 2);
      break;
    case ModelQuantity::kMuscle:
      set_muscle(m, i, v);
      break;
    case ModelQuantity::kReference:
      mju_copy(m.eq_solref + mjNREF * i, v, mjNREF);
      break;
    case ModelQuantity::kImpedance:
      mju_copy(m.eq_solimp + mjNIMP * i, v, mjNIMP);
      break;
  }
}

struct Copying {
  const mjModel* source;
  mjModel* copy = nullptr;
  void operator()() { copy = mj_copyModel(nullptr, source); }
};

// A spring length that was not given is the path's length where springs rest; the engine computes
// it again when it is marked by -1.
struct Unmarking {
  mjModel* model;
  mjData* data = nullptr;
  void operator()() {
    data = mj_makeData(model);
    mju_copy(data->qpos, model->qpos_spring, model->nq);
    mj_kinematics(model, data);
    mj_comPos(model, data);
    mj_tendon(model, data);
    for (int i = 0; i < model->ntendon; ++i) {
      double& rest = model->tendon_lengthspring[i];
      if (rest == data->ten_length[i]) rest = -1.0;
    }
  }
};

// The constants that the compiler derives: weights, lengths, anchors, mean inertia.
struct Deriving {
  mjModel* model;
  mjData* data;
  void operator()() { mj_setConst(model, data); }
};

}  // namespace

EngineModel EngineModel::changed(const std::vector<Change>& changes) const {
  std::string reason;
  Copying copying{.source = model_.get()};
  if (!contained(copying, reason) || copying.copy == nullptr) {
    throw Error(Fault::kMemory, "", "there is not enough memory for a copy of the scene");
  }
  const std::shared_ptr<mjModel> copy(copying.copy, mj_deleteModel);
  Unmarking unmarking{.model = copy.get()};
  const bool unmarked = contained(unmarking, reason);
  const std::unique_ptr<mjData, void (*)(mjData*)> data(unmarking.data, mj_deleteData);
  if (!unmarked) throw Error(Fault::kMemory, "", "the scene cannot be changed: " + reason);
  for (const Change& change : changes) {
    const QuantityInfo info = info_of(change.quantity);
    check_values(change, info);
    apply(*copy, change, at(info.part, change.name), Checker(change, info));
  }
  Deriving deriving{.model = copy.get(), .data = data.get()};
  if (!contained(deriving, reason)) {
    throw Error(Fault::kInternal, "", "the changed scene was refused: " + reason);
  }
  return EngineModel(copy);
}

namespace {

// The inertia in body axes again, from principal moments and their frame.
std::vector<double> inertia_of(const mjModel& m, Index body) {
  double turn[9];
  mju_quat2Mat(turn, m.body_iquat + 4 * body);
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> r(turn);
  const Eigen::Map<const Eigen::Vector3d> principal(m.body_inertia + 3 * body);
  const Eigen::Matrix3d i = r * principal.asDiagonal() * r.transpose();
  const double* c = m.body_ipos + 3 * body;
  return {c[0], c[1], c[2], i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2)};
}

std::vector<double> slice(const double* values, Index index, Index size) {
  return {values + index * size, values + (index + 1) * size};
}

}  // namespace

std::vector<double> EngineModel::values(ModelQuantity quantity, const std::string& name) const {
  const mjModel& m = *model_;
  const Index i = at(info_of(quantity).part, name);
  switch (quantity) {
    case ModelQuantity::kMass:
      return {m.body_mass[i]};
    case ModelQuantity::kInertia:
      return inertia_of(m, i);
    case ModelQuantity::kBodyPosition:
      return slice(m.body_pos, i, 3);
    case ModelQuantity::kSitePosition:
      return slice(m.site_pos, i, 3);
    case ModelQuantity::kJointDamping:
      return {m.dof_damping[velocity_of(name)]};
    case ModelQuantity::kJointFriction:
      return {m.dof_frictionloss[velocity_of(name)]};
    case ModelQuantity::kLengthRange:
      return slice(m.actuator_lengthrange, i, 2);
    case ModelQuantity::kMuscle: {
      const double* prm = m.actuator_gainprm + mjNGAIN * i;
      return {prm[2], prm[0], prm[1]};
    }
    case ModelQuantity::kReference:
      return slice(m.eq_solref, i, mjNREF);
    case ModelQuantity::kImpedance:
      return slice(m.eq_solimp, i, mjNIMP);
  }
  return {};
}

}  // namespace ulna
