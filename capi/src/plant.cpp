#include <ulna/plant.h>

#include <memory>
#include <vector>

#include "guard.hpp"
#include "handles.hpp"
#include "plant/capstan_robot.hpp"
#include "plant/carriage.hpp"
#include "plant/friction.hpp"
#include "signal/finite.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

const PlanarRobot& robot_of(const ulna_robot* handle) { return *deref(handle, "robot").robot; }

Vector2 row_of(const Matrix& m, Index i) { return m.row(i).transpose(); }

// By value: a transpose would refer to a vector that is gone.
Eigen::RowVector2d as_row(const Vector2& v) { return v.transpose(); }

// rows x 2, finite, as many rows as `like`.
Matrix pairs(const ulna_view* view, const char* argument, Index rows = -1) {
  const Matrix m = map_view(view, argument);
  require(m.cols() == 2, argument,
          std::string(argument) + " must have two columns, one a joint or axis");
  require(rows < 0 || m.rows() == rows, argument,
          std::string(argument) + " has " + std::to_string(m.rows()) + " rows, " +
              std::to_string(rows) + " are expected");
  require_finite(m, argument);
  return m;
}

// What `make(row)` gives for each row, as one array.
template <class Make>
void write_rows(Index rows, Index width, const Make& make, double* out, int64_t capacity,
                int64_t* out_count) {
  deref(out_count, "out_count");
  std::vector<double> values(static_cast<std::size_t>(rows * width));
  for (Index i = 0; i < rows; ++i) {
    Eigen::Map<RowMajor>(values.data() + i * width, 1, width) = make(i);
  }
  write_array(values.data(), rows * width, out, capacity, out_count);
}

RowMajor flat(const Matrix& m) {
  const RowMajor copy = m;
  return Eigen::Map<const RowMajor>(copy.data(), 1, copy.size());
}

// The states of rows of angles, and of rates where there are any.
struct States {
  const PlanarRobot& robot;
  Matrix angle;
  Matrix rate;

  States(const ulna_robot* handle, const ulna_view* angles, const ulna_view* rates)
      : robot(robot_of(handle)),
        angle(pairs(angles, "angle")),
        rate(rates == nullptr ? Matrix::Zero(angle.rows(), 2)
                              : pairs(rates, "rate", angle.rows())) {}

  Index rows() const { return angle.rows(); }
  RobotState at(Index i) const { return robot.at(row_of(angle, i), row_of(rate, i)); }
};

Matrix pairs_or_zero(const ulna_view* view, const char* argument, Index rows) {
  return view == nullptr ? Matrix::Zero(rows, 2) : pairs(view, argument, rows);
}

CapstanParameters capstan_of(const ulna_capstan_options* options) {
  const ulna_capstan_options o = read_options(options, "options");
  CapstanParameters p;
  for (std::size_t j = 0; j < 2; ++j) {
    if (o.link_m != nullptr) p.link_m[j] = o.link_m[j];
    if (o.dry != nullptr) p.dry[j] = {o.dry[3 * j], o.dry[3 * j + 1], 0.0, o.dry[3 * j + 2]};
  }
  for (std::size_t i = 0; i < 5 && o.alpha != nullptr; ++i) p.alpha[i] = o.alpha[i];
  return p;
}

}  // namespace

ulna_status ulna_robot_new_capstan(const ulna_capstan_options* options, ulna_robot** out_robot) {
  return guarded([&] {
    ulna_robot*& out = deref(out_robot, "out_robot");
    out = new ulna_robot{std::make_shared<const CapstanRobot>(capstan_of(options))};
  });
}

ulna_status ulna_robot_new_carriage(const ulna_carriage_options* options, ulna_robot** out_robot) {
  return guarded([&] {
    ulna_robot*& out = deref(out_robot, "out_robot");
    const ulna_carriage_options o = read_options(options, "options");
    CarriageParameters p;
    if (o.mass_kg != 0.0) p.mass_kg = o.mass_kg;
    if (o.damping_n_s_m != 0.0) p.damping_n_s_m = o.damping_n_s_m < 0.0 ? 0.0 : o.damping_n_s_m;
    if (o.travel_m != 0.0) p.travel_m = o.travel_m;
    out = new ulna_robot{std::make_shared<const Carriage>(p)};
  });
}

void ulna_robot_free(ulna_robot* robot) { delete robot; }

ulna_status ulna_robot_parameters(const ulna_robot* robot, double* out, int64_t capacity,
                                  int64_t* out_count) {
  return guarded([&] {
    const Vector values = robot_of(robot).parameters();
    write_array(values.data(), values.size(), out, capacity, out_count);
  });
}

ulna_status ulna_robot_forward(const ulna_robot* robot, const ulna_view* angle, double* out,
                               int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const States states(robot, angle, nullptr);
    write_rows(
        states.rows(), 2, [&](Index i) { return as_row(states.at(i).position); }, out, capacity,
        out_count);
  });
}

ulna_status ulna_robot_inverse(const ulna_robot* robot, const ulna_view* position, int32_t limits,
                               double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    require(limits == ULNA_LIMITS_KEEP || limits == ULNA_LIMITS_IGNORE, "limits",
            "limits must be ULNA_LIMITS_KEEP or ULNA_LIMITS_IGNORE");
    const RowMajor angles = inverse_kinematics(robot_of(robot), pairs(position, "position"),
                                               limits == ULNA_LIMITS_IGNORE);
    write_array(angles.data(), angles.size(), out, capacity, out_count);
  });
}

ulna_status ulna_robot_jacobian(const ulna_robot* robot, const ulna_view* angle, double* out,
                                int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const States states(robot, angle, nullptr);
    write_rows(
        states.rows(), 4, [&](Index i) { return flat(states.at(i).jacobian); }, out, capacity,
        out_count);
  });
}

ulna_status ulna_robot_jacobian_rate(const ulna_robot* robot, const ulna_view* angle,
                                     const ulna_view* rate, double* out, int64_t capacity,
                                     int64_t* out_count) {
  return guarded([&] {
    const States states(robot, angle, &deref(rate, "rate"));
    write_rows(
        states.rows(), 4, [&](Index i) { return flat(states.at(i).jacobian_rate); }, out, capacity,
        out_count);
  });
}

ulna_status ulna_robot_quality(const ulna_robot* robot, const ulna_view* angle, double* out,
                               int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const States states(robot, angle, nullptr);
    write_rows(
        states.rows(), 1,
        [&](Index i) { return Matrix::Constant(1, 1, jacobian_quality(states.at(i).jacobian)); },
        out, capacity, out_count);
  });
}

ulna_status ulna_robot_inertia(const ulna_robot* robot, const ulna_view* angle, double* out,
                               int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const States states(robot, angle, nullptr);
    write_rows(
        states.rows(), 4, [&](Index i) { return flat(states.at(i).inertia); }, out, capacity,
        out_count);
  });
}

ulna_status ulna_robot_coriolis(const ulna_robot* robot, const ulna_view* angle,
                                const ulna_view* rate, double* out, int64_t capacity,
                                int64_t* out_count) {
  return guarded([&] {
    const States states(robot, angle, &deref(rate, "rate"));
    write_rows(
        states.rows(), 4, [&](Index i) { return flat(states.at(i).coriolis); }, out, capacity,
        out_count);
  });
}

ulna_status ulna_robot_friction(const ulna_robot* robot, const ulna_view* rate, double* out,
                                int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const PlanarRobot& r = robot_of(robot);
    const Matrix rates = pairs(rate, "rate");
    write_rows(
        rates.rows(), 2,
        [&](Index i) { return as_row(r.at(Vector2::Zero(), row_of(rates, i)).friction); }, out,
        capacity, out_count);
  });
}

ulna_status ulna_robot_inverse_dynamics(const ulna_robot* robot, const ulna_view* angle,
                                        const ulna_view* rate, const ulna_view* acceleration,
                                        const ulna_view* force, double* out, int64_t capacity,
                                        int64_t* out_count) {
  return guarded([&] {
    const States s(robot, angle, &deref(rate, "rate"));
    const Matrix a = pairs(acceleration, "acceleration", s.rows());
    const Matrix f = pairs_or_zero(force, "force", s.rows());
    const auto torque = [&](Index i) {
      return as_row(inverse_dynamics(s.robot, row_of(s.angle, i), row_of(s.rate, i), row_of(a, i),
                                     row_of(f, i)));
    };
    write_rows(s.rows(), 2, torque, out, capacity, out_count);
  });
}

ulna_status ulna_robot_forward_dynamics(const ulna_robot* robot, const ulna_view* angle,
                                        const ulna_view* rate, const ulna_view* torque,
                                        const ulna_view* force, double* out, int64_t capacity,
                                        int64_t* out_count) {
  return guarded([&] {
    const States s(robot, angle, &deref(rate, "rate"));
    const Matrix t = pairs(torque, "torque", s.rows());
    const Matrix f = pairs_or_zero(force, "force", s.rows());
    const auto acceleration = [&](Index i) {
      return as_row(forward_dynamics(s.robot, row_of(s.angle, i), row_of(s.rate, i), row_of(t, i),
                                     row_of(f, i)));
    };
    write_rows(s.rows(), 2, acceleration, out, capacity, out_count);
  });
}

ulna_status ulna_robot_regressor(const ulna_robot* robot, const ulna_view* angle,
                                 const ulna_view* rate, const ulna_view* acceleration, double* out,
                                 int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const States s(robot, angle, &deref(rate, "rate"));
    const Matrix a = pairs(acceleration, "acceleration", s.rows());
    const auto rows = [&](Index i) {
      return flat(s.robot.regressor(row_of(s.angle, i), row_of(s.rate, i), row_of(a, i)));
    };
    const Index width = 2 * s.robot.parameters().size();
    write_rows(s.rows(), width, rows, out, capacity, out_count);
  });
}

ulna_status ulna_friction_force(const ulna_friction* friction, const ulna_view* speed, double* out,
                                int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const ulna_friction o = read_options(&deref(friction, "friction"), "friction");
    const Friction f{o.sliding, o.breakaway, o.viscous, o.threshold};
    check_friction(f, "friction", 0);
    const Matrix speeds = map_view(speed, "speed");
    require(speeds.cols() == 1, "speed", "speed must have one column");
    require_finite(speeds, "speed");
    const auto force = [&](Index i) { return friction_force(f, speeds(i, 0)); };
    const Vector values = Vector::NullaryExpr(speeds.rows(), force);
    write_array(values.data(), values.size(), out, capacity, out_count);
  });
}
