#include "plant/engine/model.hpp"

#include <mujoco/mjxmacro.h>
#include <mujoco/mujoco.h>

#include <locale.h>  // NOLINT: uselocale is POSIX
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <mutex>

#include "base/error.hpp"
#include "plant/engine/trap.hpp"

namespace ulna {
namespace {

using engine::contained;

constexpr int kMessageSize = 1000;

int object_of(Part part) {
  switch (part) {
    case Part::kBody:
      return mjOBJ_BODY;
    case Part::kJoint:
      return mjOBJ_JOINT;
    case Part::kGeom:
      return mjOBJ_GEOM;
    case Part::kSite:
      return mjOBJ_SITE;
    case Part::kTendon:
      return mjOBJ_TENDON;
    case Part::kActuator:
      return mjOBJ_ACTUATOR;
    case Part::kEquality:
      return mjOBJ_EQUALITY;
  }
  return mjOBJ_UNKNOWN;
}

// The engine reads numbers with the locale's decimal point; MJCF has a point always.
class PointLocale {
 public:
  PointLocale() : c_(newlocale(LC_ALL_MASK, "C", nullptr)), former_(uselocale(c_)) {}
  ~PointLocale() {
    uselocale(former_);
    freelocale(c_);
  }
  PointLocale(const PointLocale&) = delete;
  PointLocale& operator=(const PointLocale&) = delete;

 private:
  locale_t c_;
  locale_t former_;
};

// The engine's compiler keeps the last text it read in a place of the whole process.
std::mutex& compiler() {
  static std::mutex mutex;
  return mutex;
}

// The engine's words as the end of one of our sentences.
std::string one_line(const char* text) {
  std::string line;
  for (const char* c = text; *c != '\0'; ++c) {
    if (*c != '\n') {
      line += *c;
    } else if (!line.empty() && line.back() != ' ' && c[1] != '\0') {
      line += ", ";
    }
  }
  return line;
}

struct Loading {
  const char* name;
  const mjVFS* files;
  char message[kMessageSize] = "";
  mjModel* model = nullptr;
  void operator()() { model = mj_loadXML(name, files, message, kMessageSize); }
};

mjModel* load(const char* name, const mjVFS* files) {
  const std::lock_guard lock(compiler());
  const PointLocale locale;
  Loading loading{.name = name, .files = files};
  std::string reason;
  if (!contained(loading, reason)) {
    throw Error(Fault::kFormat, "scene",
                "the scene cannot be compiled: " + one_line(reason.c_str()));
  }
  if (loading.model == nullptr) {
    throw Error(Fault::kFormat, "scene",
                "the scene cannot be compiled: " + one_line(loading.message));
  }
  return loading.model;
}

int rows_of_equality(int type) {
  switch (type) {
    case mjEQ_CONNECT:
      return 3;
    case mjEQ_WELD:
      return 6;
    default:
      return 1;
  }
}

bool can_touch(const mjModel& m, int a, int b) {
  const int body_a = m.geom_bodyid[a];
  const int body_b = m.geom_bodyid[b];
  if (m.body_weldid[body_a] == m.body_weldid[body_b]) return false;
  return (m.geom_contype[a] & m.geom_conaffinity[b]) != 0 ||
         (m.geom_contype[b] & m.geom_conaffinity[a]) != 0;
}

// Contacts that can be at once: at most eight a pair of geoms (two boxes).
int contacts_of(const mjModel& m, Index wanted) {
  Index most = Index{8} * m.npair;
  for (int a = 0; a < m.ngeom && most < wanted; ++a) {
    for (int b = a + 1; b < m.ngeom && most < wanted; ++b) most += can_touch(m, a, b) ? 8 : 0;
  }
  return static_cast<int>(std::min(most, wanted));
}

// The number of constraint rows that the model can ask for.
int rows_of(const mjModel& m, int contacts) {
  int rows = 0;
  for (int i = 0; i < m.neq; ++i) rows += rows_of_equality(m.eq_type[i]);
  // Limits have a row a side, because with a margin both can be active.
  for (int i = 0; i < m.njnt; ++i) rows += m.jnt_limited[i] != 0 ? 2 : 0;
  for (int i = 0; i < m.ntendon; ++i) rows += m.tendon_limited[i] != 0 ? 2 : 0;
  // Friction that is zero now can be changed in the compiled model, so every place has its row.
  rows += m.nv + m.ntendon;
  int per_contact = 1;
  for (int i = 0; i < m.ngeom; ++i) per_contact = std::max(per_contact, 2 * (m.geom_condim[i] - 1));
  for (int i = 0; i < m.npair; ++i) per_contact = std::max(per_contact, 2 * (m.pair_dim[i] - 1));
  return rows + contacts * per_contact;
}

// The compiled model's arrays do not depend on these sizes, only a run's do.
void make_room(mjModel& m, const EngineRoom& room) {
  require(room.contacts >= 0 && room.contacts <= 5000, "contacts",
          "contacts must be between 0 and 5000");
  m.nconmax = contacts_of(m, room.contacts);
  require(room.rows >= 0 && room.rows <= 20000, "rows", "rows must be between 0 and 20000");
  const int rows = std::max(rows_of(m, m.nconmax), 1);
  m.njmax = room.rows == 0 ? rows : std::min(rows, static_cast<int>(room.rows));
  const double side = m.njmax + m.nv;
  // Dense work arrays of rows by degrees of freedom, and as many of degrees of freedom squared.
  const double stack = 20000.0 + 6.0 * side * m.nv + 40.0 * side + 2.0 * m.njmax;
  m.nstack = static_cast<int>(std::min(stack, 2e8));
}

std::shared_ptr<const mjModel> own(mjModel* model) {
  return {model, [](const mjModel* m) { mj_deleteModel(const_cast<mjModel*>(m)); }};
}

}  // namespace

const char* word(Part part) {
  switch (part) {
    case Part::kBody:
      return "body";
    case Part::kJoint:
      return "joint";
    case Part::kGeom:
      return "geom";
    case Part::kSite:
      return "site";
    case Part::kTendon:
      return "tendon";
    case Part::kActuator:
      return "actuator";
    case Part::kEquality:
      return "equality";
  }
  return "part";
}

EngineModel EngineModel::from_text(const std::string& mjcf, const EngineRoom& room) {
  constexpr const char* kName = "scene.xml";
  require(mjcf.size() < 100'000'000, "scene", "the scene's text is longer than 100 MB");
  auto files = std::make_unique<mjVFS>();  // two megabytes: not for the stack
  mj_defaultVFS(files.get());
  const std::unique_ptr<mjVFS, void (*)(mjVFS*)> freed(files.get(), mj_deleteVFS);
  // An empty file is refused by the engine as one that cannot be made.
  require(!mjcf.empty(), "scene", "the scene's text is empty");
  if (mj_makeEmptyFileVFS(files.get(), kName, static_cast<int>(mjcf.size())) != 0) {
    throw Error(Fault::kMemory, "scene", "there is not enough memory for the scene's text");
  }
  std::memcpy(files->filedata[mj_findFileVFS(files.get(), kName)], mjcf.data(), mjcf.size());
  const auto model = own(load(kName, files.get()));
  make_room(const_cast<mjModel&>(*model), room);  // ours alone until it is returned
  return EngineModel(model);
}

EngineModel EngineModel::from_file(const std::string& path, const EngineRoom& room) {
  if (std::filesystem::is_directory(path)) {
    throw Error(Fault::kFile, "path", path + " is a folder: give the name of a file");
  }
  if (!std::filesystem::is_regular_file(path)) {
    throw Error(Fault::kFile, "path", "there is no file " + path);
  }
  const auto model = own(load(path.c_str(), nullptr));
  make_room(const_cast<mjModel&>(*model), room);
  return EngineModel(model);
}

Index EngineModel::count(Part part) const {
  switch (part) {
    case Part::kBody:
      return model_->nbody;
    case Part::kJoint:
      return model_->njnt;
    case Part::kGeom:
      return model_->ngeom;
    case Part::kSite:
      return model_->nsite;
    case Part::kTendon:
      return model_->ntendon;
    case Part::kActuator:
      return model_->nu;
    case Part::kEquality:
      return model_->neq;
  }
  return 0;
}

Index EngineModel::find(Part part, const std::string& name) const {
  return mj_name2id(model_.get(), object_of(part), name.c_str());
}

Index EngineModel::at(Part part, const std::string& name) const {
  const Index index = find(part, name);
  if (index >= 0) return index;
  std::string names;
  for (Index i = 0; i < std::min<Index>(count(part), 30); ++i) {
    names += (i == 0 ? "" : ", ") + this->name(part, i);
  }
  throw Error(Fault::kArgument, word(part),
              std::string("there is no ") + word(part) + " '" + name +
                  "'; the names are: " + (names.empty() ? "none" : names),
              std::string(word(part)) + " " + name);
}

std::string EngineModel::name(Part part, Index index) const {
  const char* text = mj_id2name(model_.get(), object_of(part), static_cast<int>(index));
  return text == nullptr ? "" : text;
}

Index EngineModel::positions() const { return model_->nq; }
Index EngineModel::velocities() const { return model_->nv; }
Index EngineModel::controls() const { return model_->nu; }
Index EngineModel::activations() const { return model_->na; }

namespace {

Index single_joint(const EngineModel& model, const std::string& joint) {
  const Index j = model.at(Part::kJoint, joint);
  const int type = model.raw()->jnt_type[j];
  require(type == mjJNT_HINGE || type == mjJNT_SLIDE, "joint",
          "joint '" + joint + "' has more than one degree of freedom");
  return j;
}

}  // namespace

Index EngineModel::position_of(const std::string& joint) const {
  return model_->jnt_qposadr[single_joint(*this, joint)];
}

Index EngineModel::velocity_of(const std::string& joint) const {
  return model_->jnt_dofadr[single_joint(*this, joint)];
}

Vector EngineModel::reference() const {
  return Eigen::Map<const Vector>(model_->qpos0, model_->nq);
}

Matrix EngineModel::joint_range() const {
  Matrix range(model_->njnt, 2);
  for (Index j = 0; j < model_->njnt; ++j) {
    range(j, 0) = model_->jnt_limited[j] != 0 ? model_->jnt_range[2 * j] : -kInfinity;
    range(j, 1) = model_->jnt_limited[j] != 0 ? model_->jnt_range[2 * j + 1] : kInfinity;
  }
  return range;
}

double EngineModel::timestep() const { return model_->opt.timestep; }

Vector EngineModel::joint_damping() const {
  return Eigen::Map<const Vector>(model_->dof_damping, model_->nv);
}

Vector EngineModel::joint_friction() const {
  return Eigen::Map<const Vector>(model_->dof_frictionloss, model_->nv);
}

Index EngineModel::constraint_rows() const { return model_->njmax; }

namespace {

template <class T>
double difference_of(const T* a, const T* b, std::size_t size) {
  double largest = 1.0;
  double difference = 0.0;
  for (std::size_t i = 0; i < size; ++i) {
    largest = std::max(largest, std::fabs(static_cast<double>(a[i])));
    difference =
        std::max(difference, std::fabs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  }
  return difference / largest;
}

}  // namespace

std::vector<ArrayDifference> EngineModel::differences(const EngineModel& other) const {
  const mjModel* m = model_.get();
  const mjModel* n = other.model_.get();
  bool same_shape = true;
#define X(name) same_shape = same_shape && m->name == n->name;
  MJMODEL_INTS
#undef X
  require(same_shape, "other", "the two models have not the same shape");
  std::vector<ArrayDifference> found;
  // The macro's sizes are written in terms of the model's, which it expects as `m`.
#define X(type, name, rows, columns)                                                              \
  {                                                                                               \
    const double d = difference_of(                                                               \
        m->name, n->name, static_cast<std::size_t>(m->rows) * static_cast<std::size_t>(columns)); \
    if (d > 0.0) found.push_back({#name, d});                                                     \
  }
  MJMODEL_POINTERS_PREAMBLE(m)
  MJMODEL_POINTERS
#undef X
  const double mean = std::fabs(m->stat.meaninertia - n->stat.meaninertia);
  if (mean > 0.0) found.push_back({"stat.meaninertia", mean / std::max(1.0, m->stat.meaninertia)});
  return found;
}

}  // namespace ulna
