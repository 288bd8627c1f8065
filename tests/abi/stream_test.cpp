// Every update of a stream of torques is fit for real time through the interface: it allocates
// nothing, whatever is missing, with every solver.
#include <gtest/gtest.h>
#include <ulna/ulna.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "allocations.hpp"

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

ulna_view rows(const std::vector<double>& values, int64_t columns) {
  const auto size = static_cast<int64_t>(values.size());
  return {values.data(), size / columns, columns, columns, 1};
}

// A person with an accelerometer on every tenth link and a shoe; the stack of tasks and the solver
// are what the test is about.
class Stream {
 public:
  explicit Stream(const ulna_torque_options& options) {
    ulna_human_options human = {};
    human.struct_size = sizeof human;
    human.height_m = 1.8;
    human.mass_kg = 75.0;
    EXPECT_EQ(ulna_body_new_human(&human, &body_), ULNA_OK);
    std::vector<double> table;
    std::vector<std::string> names;
    for (int link = 0; link < 49; link += 10) {
      put(table, ULNA_SENSOR_ACCELEROMETER, link, 0.1);
      names.push_back("imu " + std::to_string(link));
    }
    put(table, ULNA_SENSOR_EXTERNAL_WRENCH, 40, 1.0);
    names.emplace_back("shoe");
    std::vector<const char*> pointers;
    for (const std::string& name : names) pointers.push_back(name.c_str());
    const ulna_view view = rows(table, ULNA_SENSOR_VALUES);
    EXPECT_EQ(
        ulna_sensors_new(body_, &view, pointers.data(), std::ssize(pointers), nullptr, &sensors_),
        ULNA_OK);
    EXPECT_EQ(ulna_torque_stream_new(sensors_, &options, &stream_), ULNA_OK);
  }
  ~Stream() {
    ulna_torque_stream_free(stream_);
    ulna_sensors_free(sensors_);
    ulna_body_free(body_);
  }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  // Everything there, readings missing, no state, and fewer outputs. The number of calls that
  // failed.
  int update_all_kinds() noexcept {
    int failed = 0;
    for (const double reading : {1.0, kNan}) {
      for (const double angle : {0.1, kNan}) {
        for (double& value : angle_) value = angle;
        for (double& value : measured_) value = reading;
        for (const bool all : {true, false}) {
          failed += ulna_torque_stream_update(stream_, base_, angle_, rate_, measured_, torque_,
                                              all ? deviation_ : nullptr,
                                              all ? residual_ : nullptr) == ULNA_OK
                        ? 0
                        : 1;
        }
      }
    }
    return failed;
  }
  double torque() const { return torque_[0]; }

 private:
  static void put(std::vector<double>& table, int kind, int link, double deviation) {
    std::vector<double> row(ULNA_SENSOR_VALUES, 0.0);
    row[0] = kind;
    row[1] = link;
    row[6] = row[10] = row[14] = 1.0;
    row[15] = deviation;
    for (std::size_t k = 16; k < row.size(); ++k) row[k] = kNan;
    table.insert(table.end(), row.begin(), row.end());
  }

  ulna_body* body_ = nullptr;
  ulna_sensors* sensors_ = nullptr;
  ulna_torque_stream* stream_ = nullptr;
  double base_[10] = {0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  double angle_[48] = {}, rate_[48] = {}, measured_[21] = {};
  double torque_[48] = {}, deviation_[48] = {}, residual_[6] = {};
};

TEST(TorqueStream, AllocatesNothingWhateverComes) {
  for (const int32_t solver : {ULNA_SOLVER_CLOSED_FORM, ULNA_SOLVER_SPARSE}) {
    for (const int32_t stack : {0, 1}) {
      if (solver == ULNA_SOLVER_SPARSE && stack == 1) continue;
      SCOPED_TRACE(testing::Message() << "solver " << solver << ", stack " << stack);
      ulna_torque_options options = {};
      options.struct_size = sizeof options;
      options.solver = solver;
      options.stack = stack;
      Stream stream(options);
      int failed = 0;
      const long count = ulna::made::allocations_of([&] { failed = stream.update_all_kinds(); });
      EXPECT_EQ(failed, 0);
      EXPECT_TRUE(std::isnan(stream.torque()));  // the last frame had no state
      if (count >= 0) {
        EXPECT_EQ(count, 0);
      }
    }
  }
}

// The count is of the library as well: making a stream allocates.
TEST(TorqueStream, IsWatchedWhereItAllocates) {
  ulna_torque_options options = {};
  options.struct_size = sizeof options;
  const long count = ulna::made::allocations_of([&] { const Stream stream(options); });
  if (count < 0) GTEST_SKIP() << "a sanitizer has taken the allocator over";
  EXPECT_GT(count, 100);
}

}  // namespace
