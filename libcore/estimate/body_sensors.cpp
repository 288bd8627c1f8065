#include "estimate/body_sensors.hpp"

#include <cmath>
#include <set>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

bool is_free(BodySensorKind kind) {
  return kind == BodySensorKind::kFreeWrench || kind == BodySensorKind::kFreeForce;
}

bool is_external(BodySensorKind kind) {
  return is_free(kind) || kind == BodySensorKind::kExternalWrench ||
         kind == BodySensorKind::kExternalForce;
}

bool is_of_hinge(BodySensorKind kind) {
  return kind == BodySensorKind::kJointAcceleration || kind == BodySensorKind::kJointTorque;
}

// Components that have a deviation: rows, or those of a free wrench.
Index components(BodySensorKind kind) {
  if (kind == BodySensorKind::kFreeWrench) return 6;
  if (kind == BodySensorKind::kFreeForce) return 3;
  return sensor_rows(kind);
}

Vector spread_over(const BodySensor& sensor, const BodyPrior& prior, const std::string& what) {
  const Index count = components(sensor.kind);
  const Vector& given = sensor.deviation;
  Vector deviation(count);
  if (given.size() == 0 && is_free(sensor.kind)) {
    deviation.head(3).setConstant(prior.force);
    if (count == 6) deviation.tail(3).setConstant(prior.moment);
  } else if (given.size() == count) {
    deviation = given;
  } else if (given.size() == 1) {
    deviation.setConstant(given[0]);
  } else if (given.size() == 2 && count == 6) {
    deviation << Vector3::Constant(given[0]), Vector3::Constant(given[1]);
  } else {
    throw Error(Fault::kArgument, "deviation",
                what + "has " + std::to_string(given.size()) + " deviations for " +
                    std::to_string(count) + " rows",
                "sensor " + sensor.name);
  }
  for (const double d : deviation) {
    if (std::isfinite(d) && d > 0.0) continue;
    throw Error(Fault::kArgument, "deviation",
                what + "has a deviation that is not positive and finite", "sensor " + sensor.name);
  }
  return deviation;
}

void check_sensor(const BodyTree& body, const BodySensor& sensor, const std::string& what) {
  require(!sensor.name.empty(), "name", "a sensor has no name");
  require(sensor.link >= 0 && sensor.link < body.size(), "link",
          what + "is on link " + std::to_string(sensor.link) + "; the body has links 0 to " +
              std::to_string(body.size() - 1));
  if (is_of_hinge(sensor.kind)) {
    require(body.dof(sensor.link) >= 0, "link",
            what + "measures a hinge, but link '" + body.link(sensor.link).name + "' has none");
  }
  require(sensor.kind != BodySensorKind::kJointWrench || sensor.link > 0, "link",
          what + "measures a joint, but the base has none");
  require(sensor.position.allFinite() && sensor.orientation.allFinite(), "position",
          what + "holds a number that is not finite");
  // Orientations from files have as many as six digits.
  const Matrix3 square = sensor.orientation.transpose() * sensor.orientation;
  require((square - Matrix3::Identity()).norm() < 1e-4 && sensor.orientation.determinant() > 0.0,
          "orientation", what + "has an orientation that is no rotation");
  require(sensor.frame != SensorFrame::kWorld || is_external(sensor.kind), "frame",
          what + "has a place in the world, which only external wrenches have");
}

void check_prior(const BodyPrior& p) {
  for (const double d : {p.base_acceleration, p.base_angular_acceleration, p.joint_acceleration,
                         p.force, p.moment, p.untouched_force, p.untouched_moment}) {
    require(std::isfinite(d) && d > 0.0, "prior", "deviations of a prior must be positive");
  }
}

}  // namespace

Index sensor_rows(BodySensorKind kind) {
  switch (kind) {
    case BodySensorKind::kAccelerometer:
    case BodySensorKind::kAngularAcceleration:
    case BodySensorKind::kExternalForce:
      return 3;
    case BodySensorKind::kJointAcceleration:
    case BodySensorKind::kJointTorque:
      return 1;
    case BodySensorKind::kExternalWrench:
    case BodySensorKind::kJointWrench:
      return 6;
    case BodySensorKind::kFreeWrench:
    case BodySensorKind::kFreeForce:
      return 0;
  }
  return 0;
}

SensorSuite::SensorSuite(std::shared_ptr<const BodyTree> body, std::vector<BodySensor> sensors,
                         const BodyPrior& prior)
    : body_(std::move(body)), sensors_(std::move(sensors)), prior_(prior) {
  require(body_ != nullptr, "body", "sensors need a body");
  check_prior(prior);
  std::set<std::string> names;
  for (BodySensor& sensor : sensors_) {
    const std::string what = "sensor '" + sensor.name + "' ";
    check_sensor(*body_, sensor, what);
    require(names.insert(sensor.name).second, "name",
            "two sensors have the name '" + sensor.name + "'");
    sensor.deviation = spread_over(sensor, prior, what);
    first_.push_back(rows_);
    rows_ += sensor_rows(sensor.kind);
  }
}

Index SensorSuite::find(const std::string& name) const {
  for (Index i = 0; i < size(); ++i) {
    if (sensor(i).name == name) return i;
  }
  return -1;
}

std::vector<std::string> SensorSuite::row_names() const {
  std::vector<std::string> names;
  for (const BodySensor& s : sensors_) {
    const Index count = sensor_rows(s.kind);
    for (Index k = 0; k < count; ++k) {
      std::string name = s.name;
      if (count > 1) {
        name += count == 3 ? "." : k < 3 ? ".force_" : ".moment_";
        name += "xyz"[k % 3];
      }
      names.push_back(name);
    }
  }
  return names;
}

Vector SensorSuite::deviations() const {
  Vector all(rows_);
  for (Index i = 0; i < size(); ++i) {
    const Index count = sensor_rows(sensor(i).kind);
    all.segment(row(i), count) = sensor(i).deviation.head(count);
  }
  return all;
}

SensorSuite SensorSuite::with_deviations(const VectorRef& deviation) const {
  require(deviation.size() == rows_, "deviation",
          "there are " + std::to_string(rows_) + " rows of measurements and " +
              std::to_string(deviation.size()) + " deviations");
  std::vector<BodySensor> sensors = sensors_;
  for (Index i = 0; i < size(); ++i) {
    const Index count = sensor_rows(sensor(i).kind);
    if (count > 0)
      sensors[static_cast<std::size_t>(i)].deviation = deviation.segment(row(i), count);
  }
  return SensorSuite(body_, std::move(sensors), prior_);
}

}  // namespace ulna
