// A person who bows, on a force plate and with a sensor on the torso: the numbers of the recording
// and how far the two ways to the ankle's torque are apart.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>

#include "estimate/sensor_variances.hpp"

namespace ulna {
namespace {

// Model of the recording (its JSON file), written out: the file is read in Python.
std::shared_ptr<const BodyTree> bowing_body() {
  std::vector<BodyLink> links(3);
  const auto fill = [](BodyLink& link, const char* name, double mass, double height,
                       const Vector3& inertia) {
    link.name = name;
    link.mass = mass;
    link.centre = Vector3(0, 0, height);
    link.inertia = inertia.asDiagonal();
    link.axis = Vector3::UnitY();
  };
  fill(links[0], "foot", 3.0639, 0.030877, {0.0051523, 0.014672, 0.017877});
  fill(links[1], "leg", 25.5563, 0.3985, {1.411, 1.3813, 0.086802});
  fill(links[2], "torso", 33.0707, 0.26923, {1.0755, 0.836, 0.31343});
  links[1].parent = 0;
  links[1].joint = "ankle";
  links[1].position = Vector3(-0.057906, 0, 0.061755);
  links[2].parent = 1;
  links[2].joint = "hip";
  links[2].position = Vector3(0, 0, 0.79699);
  return std::make_shared<const BodyTree>(BodyTree(std::move(links)));
}

struct Bowing {
  Matrix rows;  // as the file: time, q, q', q'' of ankle and hip, acc, foot wrench
  BodyState state(Index i) const {
    BodyState s;
    s.angle = rows.row(i).segment<2>(1).transpose();
    s.rate = rows.row(i).segment<2>(3).transpose();
    return s;
  }
};

bool read_bowing(Bowing& bowing) {
  std::ifstream file(std::string(ULNA_SOURCE_DIR) + "/../shared/data/wholebody/bowing.csv");
  if (!file) return false;
  std::string line;
  std::getline(file, line);
  std::vector<double> cells;
  while (std::getline(file, line)) {
    std::stringstream text(line);
    std::string cell;
    while (std::getline(text, cell, ',')) cells.push_back(std::stod(cell));
  }
  bowing.rows = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      cells.data(), static_cast<Index>(cells.size()) / 16, 16);
  return true;
}

double rms(const Vector& v) { return std::sqrt(v.squaredNorm() / static_cast<double>(v.size())); }

TEST(Bowing, HasTheNumbersOfTheRecording) {
  Bowing bowing;
  if (!read_bowing(bowing)) GTEST_SKIP() << "the recording is not there";
  const auto body = bowing_body();
  EXPECT_NEAR(body->mass(), 61.691, 5e-4);
  EXPECT_NEAR(bowing.rows.col(12).mean(), 604.9, 0.05);
  BodyMotion motion(body);
  const Index count = bowing.rows.rows();
  Matrix torque(count, 2), residual(count, 6);
  Vector apart(count);
  Vector6 base;
  base << 0, 0, 9.81, 0, 0, 0;
  for (Index i = 0; i < count; ++i) {
    Matrix external = Matrix::Zero(6, 3);
    external.col(0) = bowing.rows.row(i).tail<6>().transpose();
    motion.move(bowing.state(i));
    motion.accelerate(base, bowing.rows.row(i).segment<2>(5).transpose());
    Vector both(2);
    Vector6 missing;
    motion.inverse_dynamics(external, both, missing);
    torque.row(i) = both.transpose();
    residual.row(i) = missing.transpose();
    // From below: what is missing at the foot taken through the ankle.
    apart[i] = motion.link(1).hinge.dot(missing);
  }
  // The table of 60.3 holds to 0.05 N m and 0.05 N.
  EXPECT_NEAR(torque.col(0).minCoeff(), -63.9, 0.05);
  EXPECT_NEAR(torque.col(0).maxCoeff(), -15.5, 0.05);
  EXPECT_NEAR(torque.col(1).minCoeff(), -72.5, 0.05);
  EXPECT_NEAR(torque.col(1).maxCoeff(), -0.2, 0.05);
  const double table[] = {5.77, 2.55, 1.61, 6.43, 8.20, 0.86};
  for (Index k = 0; k < 6; ++k) EXPECT_NEAR(rms(residual.col(k)), table[k], 0.05) << k;
  EXPECT_NEAR(rms(apart), 7.8, 0.05);
}

// The foot stands, the torso wears a sensor, the plate is under the foot.
std::shared_ptr<const SensorSuite> bowing_suite() {
  const auto body = bowing_body();
  const Vector3 rpy(-0.0283, -1.3298, -3.1176);
  const Matrix3 imu =
      (Eigen::AngleAxisd(rpy.z(), Vector3::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Vector3::UnitY()) *
       Eigen::AngleAxisd(rpy.x(), Vector3::UnitX()))
          .toRotationMatrix();
  using Kind = BodySensorKind;
  return std::make_shared<const SensorSuite>(body, std::vector<BodySensor>{
                                                       {.name = "still",
                                                        .kind = Kind::kAccelerometer,
                                                        .link = 0,
                                                        .deviation = Vector::Constant(1, 1e-3)},
                                                       {.name = "upright",
                                                        .kind = Kind::kAngularAcceleration,
                                                        .link = 0,
                                                        .deviation = Vector::Constant(1, 1e-3)},
                                                       {.name = "imu",
                                                        .kind = Kind::kAccelerometer,
                                                        .link = 2,
                                                        .position = {0.1461, 0.0455, 0.2335},
                                                        .orientation = imu,
                                                        .deviation = Vector::Constant(1, 0.1)},
                                                       {.name = "ddq_ankle",
                                                        .kind = Kind::kJointAcceleration,
                                                        .link = 1,
                                                        .deviation = Vector::Constant(1, 0.1)},
                                                       {.name = "ddq_hip",
                                                        .kind = Kind::kJointAcceleration,
                                                        .link = 2,
                                                        .deviation = Vector::Constant(1, 0.1)},
                                                       {.name = "plate",
                                                        .kind = Kind::kExternalWrench,
                                                        .link = 0,
                                                        .deviation = Eigen::Vector2d(1.0, 0.3)},
                                                   });
}

TEST(Bowing, EstimatedVariancesCoverTheTwoWaysToTheAnkle) {
  Bowing bowing;
  if (!read_bowing(bowing)) GTEST_SKIP() << "the recording is not there";
  const auto suite = bowing_suite();
  const Index count = bowing.rows.rows();
  BodyRecording r;
  r.angle = bowing.rows.middleCols(1, 2);
  r.rate = bowing.rows.middleCols(3, 2);
  r.measured.resize(count, suite->rows());
  r.measured.leftCols(6) = Vector6(Vector6::Unit(2) * 9.81).transpose().replicate(count, 1);
  r.measured.middleCols(6, 3) = bowing.rows.middleCols(7, 3);
  r.measured.middleCols(9, 2) = bowing.rows.middleCols(5, 2);
  r.measured.rightCols(6) = bowing.rows.rightCols(6);
  // The foot does stand still; the rest is for the data to say.
  std::vector<Index> groups = variance_groups(*suite);
  for (std::size_t row = 0; row < 6; ++row) groups[row] = -1;
  const auto covered = [&](const SensorSuite& s) {
    // Ankle from above less ankle from below: the residual about the ankle's axis.
    TorqueEstimator estimator(std::make_shared<const SensorSuite>(s));
    Vector apart(count), expected(count);
    for (Index i = 0; i < count; ++i) {
      const TorqueFrame& f =
          estimator.update(bowing.state(i), r.measured.row(i).transpose(), false);
      const Vector6& ankle = estimator.motion().link(1).hinge;
      apart[i] = ankle.dot(f.residual);
      expected[i] = std::sqrt(ankle.dot(f.residual_covariance * ankle));
    }
    const auto inside = (apart.array().abs() < 1.96 * expected.array()).count();
    return std::array<double, 3>{rms(apart), rms(expected),
                                 static_cast<double>(inside) / static_cast<double>(count)};
  };
  const auto before = covered(*suite);
  EXPECT_GT(before[0], 3.0 * before[1]);  // small typed-in variances do not cover it
  const SensorVariances found = sensor_variances(*suite, r, {.groups = groups});
  const auto after = covered(suite->with_deviations(found.deviation));
  // All rows share the likelihood, so that the ankle's axis alone is met to a third.
  EXPECT_NEAR(std::log(after[0] / after[1]), 0.0, 0.3);
  EXPECT_GT(after[2], 0.9);
  RecordProperty("ankle_apart_nm", std::to_string(after[0]));
  RecordProperty("ankle_deviation_nm", std::to_string(after[1]));
  EXPECT_GT(found.deviation[suite->rows() - 2], 3.0);  // the plate's moment about y, N m
}

}  // namespace
}  // namespace ulna
