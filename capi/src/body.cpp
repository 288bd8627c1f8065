#include "body.hpp"

#include <ulna/body.h>

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <utility>

#include "arguments.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "plant/body/body_file.hpp"
#include "plant/body/human_body.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

const BodyTree& tree_of(const ulna_body* handle) { return *deref(handle, "body").tree; }

void give_body(ulna_body** place, BodyTree tree) {
  deref(place, "out_body") = new ulna_body{std::make_shared<const BodyTree>(std::move(tree))};
}

void write_rows(const RowMajor& rows, double* out, int64_t capacity, int64_t* out_count) {
  write_array(rows.data(), rows.size(), out, capacity, out_count);
}

std::string lines(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) text += (i == 0 ? "" : "\n") + names[i];
  return text;
}

std::vector<std::string> carrying_joints(const BodyTree& tree) {
  std::vector<std::string> names;
  for (const BodyLink& link : tree.links()) names.push_back(link.joint);
  return names;
}

Matrix3 symmetric(const VectorRef& v) {
  Matrix3 m;
  m << v[0], v[3], v[4], v[3], v[1], v[5], v[4], v[5], v[2];
  return m;
}

HumanMeasures measures_of(const ulna_human_options* options) {
  const ulna_human_options o = read_options(&deref(options, "options"), "options");
  HumanMeasures m;
  m.height = o.height_m;
  m.mass = o.mass_kg;
  m.density = or_default(o.density_kg_m3, m.density);
  if (flag(o.published_masses, "published_masses")) m.table = MassTable::kPublished;
  if (flag(o.spherical_joints, "spherical_joints")) m.joints = HumanJoints::k66;
  const auto segments = name_list(o.segments, o.segment_count, "segments");
  if (!segments.empty()) {
    const Vector lengths = entries_of(o.segment_lengths, "segment_lengths");
    require(lengths.size() == static_cast<Index>(segments.size()), "segment_lengths",
            "there must be one length a segment");
    for (std::size_t i = 0; i < segments.size(); ++i) {
      m.lengths.push_back({segments[i], lengths[static_cast<Index>(i)]});
    }
  }
  const auto points = name_list(o.points, o.point_count, "points");
  if (!points.empty()) {
    const Matrix at =
        rows_of(o.point_positions, "point_positions", 3, static_cast<Index>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i) {
      m.points.push_back({points[i], at.row(static_cast<Index>(i)).transpose()});
    }
  }
  return m;
}

BodyLink link_of(const VectorRef& v, const std::string& name, const std::string& joint) {
  BodyLink link;
  link.name = name;
  link.joint = joint;
  require(std::isfinite(v[0]) && v[0] == std::floor(v[0]) && std::fabs(v[0]) < 1e9, "links",
          "link '" + name + "' has a parent that is no whole number");
  link.parent = static_cast<Index>(v[0]);
  link.position = v.segment<3>(1);
  link.orientation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(v.data() + 4);
  link.axis = v.segment<3>(13);
  link.reference = v[16];
  link.mass = v[17];
  link.centre = v.segment<3>(18);
  link.inertia = symmetric(v.segment<6>(21));
  link.massless = link.mass == 0.0 && v.segment<6>(21).isZero(0.0);
  link.lower = v[27];
  link.upper = v[28];
  return link;
}

Vector values_of(const BodyLink& link) {
  Vector v(ULNA_BODY_LINK_VALUES + ULNA_BODY_SHAPE_VALUES);
  const Matrix3& r = link.orientation;
  const Matrix3& m = link.inertia;
  v << static_cast<double>(link.parent), link.position, r.row(0).transpose(), r.row(1).transpose(),
      r.row(2).transpose(), link.axis, link.reference, link.mass, link.centre, m(0, 0), m(1, 1),
      m(2, 2), m(0, 1), m(0, 2), m(1, 2), link.lower, link.upper,
      static_cast<double>(static_cast<int>(link.shape.kind)), link.shape.size, link.shape.centre,
      link.shape.axis;
  return v;
}

}  // namespace

namespace ulna::capi {

namespace {

Matrix frames_of(const ulna_view* view, const char* argument, Index rows, Index columns,
                 bool finite) {
  if (view == nullptr) return {};
  const Matrix m = map_view(view, argument);
  require((rows < 0 || m.rows() == rows) && m.cols() == columns, argument,
          std::string(argument) + " is " + std::to_string(m.rows()) + " x " +
              std::to_string(m.cols()) + ", " + (rows < 0 ? "frames" : std::to_string(rows)) +
              " x " + std::to_string(columns) + " are expected");
  if (finite) require_finite(m, argument);
  return m;
}

}  // namespace

BodyFrames read_motion(const ulna_body_motion* motion, const BodyTree& body, bool finite) {
  const ulna_body_motion m = read_options(&deref(motion, "motion"), "motion");
  require(m.angle != nullptr, "angle", "angle must not be NULL");
  BodyFrames f;
  const Index n = body.dofs();
  f.angle = frames_of(m.angle, "angle", -1, n, finite);
  const Index rows = f.angle.rows();
  f.rate = frames_of(m.rate, "rate", rows, n, finite);
  if (m.rate == nullptr) f.rate = Matrix::Zero(rows, n);
  f.acceleration = frames_of(m.acceleration, "acceleration", rows, n, finite);
  f.position = frames_of(m.position, "position", rows, 3, finite);
  f.orientation = frames_of(m.orientation, "orientation", rows, 4, finite);
  f.velocity = frames_of(m.velocity, "velocity", rows, 3, finite);
  f.angular_velocity = frames_of(m.angular_velocity, "angular_velocity", rows, 3, finite);
  f.base = frames_of(m.base_acceleration, "base_acceleration", rows, 6, finite);
  for (Index i = 0; f.orientation.size() > 0 && finite && i < rows; ++i) {
    // Quaternions of files have as few as three digits.
    if (std::fabs(f.orientation.row(i).norm() - 1.0) < 1e-2) continue;
    throw Error(Fault::kData, "orientation",
                "the orientation of frame " + std::to_string(i) + " is no unit quaternion w x y z",
                "frame " + std::to_string(i));
  }
  return f;
}

BodyState BodyFrames::state(Index i) const {
  BodyState s;
  s.angle = angle.row(i).transpose();
  s.rate = rate.row(i).transpose();
  if (position.size() > 0) s.position = position.row(i).transpose();
  if (velocity.size() > 0) s.velocity = velocity.row(i).transpose();
  if (angular_velocity.size() > 0) s.angular_velocity = angular_velocity.row(i).transpose();
  if (orientation.size() > 0) {
    const auto q = orientation.row(i);
    s.orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
  }
  return s;
}

Vector6 BodyFrames::base_at(Index i, const BodyTree& body) const {
  if (base.size() > 0) return base.row(i).transpose();
  return Vector6::Unit(2) * body.gravity();
}

Vector BodyFrames::acceleration_at(Index i) const {
  if (acceleration.size() > 0) return acceleration.row(i).transpose();
  return Vector::Zero(angle.cols());
}

}  // namespace ulna::capi

namespace {

// The body moved to the first frame.
BodyMotion at_first(const ulna_body* body, const BodyFrames& frames) {
  require(frames.frames() > 0, "angle", "the motion has no frames");
  BodyMotion moved(deref(body, "body").tree);
  moved.move(frames.state(0));
  return moved;
}

Vector3 point_of(const ulna_view* view) {
  const Vector point = entries_of(view, "point");
  require(point.size() == 3 && point.allFinite(), "point", "point must be three finite numbers");
  return point;
}

// One row a frame; `use` fills it from the body, moved and accelerated.
template <class Use>
void for_frames(const ulna_body* body, const ulna_body_motion* motion, Index columns, double* out,
                int64_t capacity, int64_t* out_count, Use use) {
  const BodyFrames frames = read_motion(motion, tree_of(body), true);
  if (out == nullptr && capacity == 0) {
    deref(out_count, "out_count") = frames.frames() * columns;
    return;
  }
  BodyMotion moved(deref(body, "body").tree);
  RowMajor rows(frames.frames(), columns);
  for (Index i = 0; i < rows.rows(); ++i) {
    moved.move(frames.state(i));
    moved.accelerate(frames.base_at(i, moved.body()), frames.acceleration_at(i));
    Vector row(columns);
    use(moved, i, row);
    rows.row(i) = row.transpose();
  }
  write_rows(rows, out, capacity, out_count);
}

}  // namespace

ulna_status ulna_body_new_human(const ulna_human_options* options, ulna_body** out_body) {
  return guarded([&] {
    deref(out_body, "out_body");
    give_body(out_body, human_body(measures_of(options)));
  });
}

ulna_status ulna_body_new_links(const ulna_view* links, const char* const* names,
                                int64_t name_count, double gravity_m_s2, ulna_body** out_body) {
  return guarded([&] {
    deref(out_body, "out_body");
    const Matrix values = map_view(links, "links");
    require(values.cols() == ULNA_BODY_LINK_VALUES, "links",
            "links must have " + std::to_string(ULNA_BODY_LINK_VALUES) + " columns");
    const auto all = name_list(names, name_count, "names");
    require(static_cast<Index>(all.size()) == 2 * values.rows(), "names",
            "names must hold two a link: of the link and of its joint");
    std::vector<BodyLink> made;
    for (Index i = 0; i < values.rows(); ++i) {
      const auto k = static_cast<std::size_t>(2 * i);
      const Vector row = values.row(i).transpose();
      made.push_back(link_of(row, all[k], all[k + 1]));
    }
    give_body(out_body, BodyTree(std::move(made), or_default(gravity_m_s2, 9.81)));
  });
}

ulna_status ulna_body_new_text(const char* text, ulna_body** out_body) {
  return guarded([&] {
    deref(out_body, "out_body");
    give_body(out_body, body_from_text(text_of(text, "text")));
  });
}

ulna_status ulna_body_read(const char* path, ulna_body** out_body) {
  return guarded([&] {
    deref(out_body, "out_body");
    give_body(out_body, read_body(text_of(path, "path")));
  });
}

ulna_status ulna_body_attach(const ulna_body* body, const char* name, const char* link,
                             double mass_kg, const ulna_view* centre, const ulna_view* inertia,
                             ulna_body** out_body) {
  return guarded([&] {
    deref(out_body, "out_body");
    Attachment part{text_of(name, "name"), text_of(link, "link"), mass_kg, {}, Matrix3::Zero()};
    const Vector at = entries_of(centre, "centre");
    require(at.size() == 3, "centre", "centre must be three numbers");
    part.centre = at;
    if (inertia != nullptr) {
      const Vector values = entries_of(inertia, "inertia");
      require(values.size() == 6, "inertia", "inertia must be six numbers: xx yy zz xy xz yz");
      part.inertia = symmetric(values);
    }
    give_body(out_body, with_attachments(tree_of(body), {part}));
  });
}

ulna_status ulna_body_rebase(const ulna_body* body, const char* base, ulna_body** out_body) {
  return guarded([&] {
    deref(out_body, "out_body");
    give_body(out_body, rebased(tree_of(body), text_of(base, "base")));
  });
}

void ulna_body_free(ulna_body* body) { delete body; }

ulna_status ulna_body_size(const ulna_body* body, int64_t* out_links, int64_t* out_hinges,
                           double* out_mass_kg, double* out_gravity_m_s2) {
  return guarded([&] {
    const BodyTree& tree = tree_of(body);
    int64_t& links = deref(out_links, "out_links");
    int64_t& hinges = deref(out_hinges, "out_hinges");
    double& mass = deref(out_mass_kg, "out_mass_kg");
    deref(out_gravity_m_s2, "out_gravity_m_s2") = tree.gravity();
    links = tree.size();
    hinges = tree.dofs();
    mass = tree.mass();
  });
}

ulna_status ulna_body_names(const ulna_body* body, int32_t kind, char* out_text, int64_t capacity,
                            int64_t* out_size) {
  return guarded([&] {
    const BodyTree& tree = tree_of(body);
    const int which = kind_of<int>(kind, 3, "kind");
    write_text(lines(which == ULNA_BODY_LINK_NAMES    ? tree.link_names()
                     : which == ULNA_BODY_JOINT_NAMES ? tree.joint_names()
                                                      : carrying_joints(tree)),
               out_text, capacity, out_size);
  });
}

ulna_status ulna_body_links(const ulna_body* body, double* out, int64_t capacity,
                            int64_t* out_count) {
  return guarded([&] {
    const BodyTree& tree = tree_of(body);
    RowMajor rows(tree.size(), ULNA_BODY_LINK_VALUES + ULNA_BODY_SHAPE_VALUES);
    for (Index i = 0; i < tree.size(); ++i) rows.row(i) = values_of(tree.link(i)).transpose();
    write_rows(rows, out, capacity, out_count);
  });
}

ulna_status ulna_body_text(const ulna_body* body, int32_t format, const char* name, char* out_text,
                           int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const BodyTree& tree = tree_of(body);
    const std::string title = text_of(name, "name");
    const int kind = kind_of<int>(format, 3, "format");
    write_text(kind == ULNA_BODY_URDF ? to_urdf(tree, title)
                                      : to_mjcf(tree, title, kind == ULNA_BODY_MJCF),
               out_text, capacity, out_size);
  });
}

ulna_status ulna_human_names(int32_t kind, char* out_text, int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const int which = kind_of<int>(kind, 3, "kind");
    write_text(lines(which == ULNA_HUMAN_SEGMENTS ? segment_names()
                     : which == ULNA_HUMAN_POINTS ? point_names()
                                                  : suit_links()),
               out_text, capacity, out_size);
  });
}

ulna_status ulna_body_poses(const ulna_body* body, const ulna_body_motion* motion, double* out,
                            int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Index links = tree_of(body).size();
    for_frames(body, motion, 7 * links, out, capacity, out_count,
               [&](const BodyMotion& moved, Index, Vector& row) {
                 for (Index k = 0; k < links; ++k) {
                   const Eigen::Quaterniond q(moved.link(k).axes);
                   row.segment<7>(7 * k) << moved.position(k), q.w(), q.x(), q.y(), q.z();
                 }
               });
  });
}

ulna_status ulna_body_point(const ulna_body* body, const ulna_body_motion* motion, const char* link,
                            const ulna_view* point, double* out, int64_t capacity,
                            int64_t* out_count) {
  return guarded([&] {
    const Index k = tree_of(body).at_link(text_of(link, "link"));
    const Vector3 at = point_of(point);
    for_frames(body, motion, 12, out, capacity, out_count,
               [&](const BodyMotion& moved, Index, Vector& row) {
                 const Matrix3 axes = moved.link(k).axes.transpose();
                 const Vector6 v = moved.velocity(k, at);
                 const Vector6 a = moved.acceleration(k, at);
                 row << axes * v.head<3>(), axes * v.tail<3>(), axes * a.head<3>(),
                     axes * a.tail<3>();
               });
  });
}

ulna_status ulna_body_inverse_dynamics(const ulna_body* body, const ulna_body_motion* motion,
                                       const ulna_view* external, double* out, int64_t capacity,
                                       int64_t* out_count) {
  return guarded([&] {
    const BodyTree& tree = tree_of(body);
    Matrix wrenches;
    if (external != nullptr) wrenches = rows_of(external, "external", 6 * tree.size());
    Vector torque(tree.dofs());
    Vector6 missing;
    Matrix now = Matrix::Zero(6, tree.size());
    for_frames(body, motion, tree.dofs() + 6, out, capacity, out_count,
               [&](BodyMotion& moved, Index i, Vector& row) {
                 require(external == nullptr || i < wrenches.rows(), "external",
                         "external must have one row a frame");
                 if (external != nullptr) now.reshaped() = wrenches.row(i).transpose();
                 moved.inverse_dynamics(now, torque, missing);
                 row << torque, missing;
               });
  });
}

ulna_status ulna_body_centroid(const ulna_body* body, const ulna_body_motion* motion, double* out,
                               int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    for_frames(body, motion, 18, out, capacity, out_count,
               [&](const BodyMotion& moved, Index, Vector& row) {
                 row << moved.centre_of_mass(), moved.centre_of_mass_velocity(),
                     moved.centroidal_momentum(), moved.centroidal_momentum_rate();
               });
  });
}

ulna_status ulna_body_mass_matrix(const ulna_body* body, const ulna_body_motion* motion,
                                  double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const BodyFrames frames = read_motion(motion, tree_of(body), true);
    BodyMotion moved = at_first(body, frames);
    const Index n = 6 + moved.body().dofs();
    Matrix inertia(n, n);
    moved.mass_matrix(inertia);
    write_rows(inertia, out, capacity, out_count);
  });
}

ulna_status ulna_body_jacobian(const ulna_body* body, const ulna_body_motion* motion,
                               const char* link, const ulna_view* point, double* out,
                               int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Index k = tree_of(body).at_link(text_of(link, "link"));
    const Vector3 at = point_of(point);
    const BodyMotion moved = at_first(body, read_motion(motion, tree_of(body), true));
    Matrix jacobian(6, 6 + moved.body().dofs());
    moved.jacobian(k, at, jacobian);
    write_rows(jacobian, out, capacity, out_count);
  });
}
