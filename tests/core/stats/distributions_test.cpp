// Against 40-digit values (tests/golden/distributions.py) and closed forms.
#include "stats/distributions.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <string>

#include "base/error.hpp"

namespace ulna {
namespace {

struct Row {
  std::string function;
  double argument, dof, value;
};

std::vector<Row> golden() {
  std::ifstream file(ULNA_SOURCE_DIR "/tests/golden/distributions.csv");
  std::vector<Row> rows;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    std::string name, argument, dof, value;
    std::getline(words, name, ',');
    std::getline(words, argument, ',');
    std::getline(words, dof, ',');
    std::getline(words, value, ',');
    rows.push_back({name, std::stod(argument), std::stod(dof), std::stod(value)});
  }
  return rows;
}

TEST(Distributions, EqualTheGoldenValues) {
  const std::vector<Row> rows = golden();
  std::map<std::string, int> checked;
  for (const Row& row : rows) {
    SCOPED_TRACE(row.function + "(" + std::to_string(row.argument) + ", " +
                 std::to_string(row.dof) + ")");
    ++checked[row.function];
    if (row.function == "normal_quantile") {
      // Documented 1e-15: four units of the last place of values up to 8.
      EXPECT_NEAR(normal_quantile(row.argument), row.value, 4e-15 * std::abs(row.value) + 1e-30);
    } else if (row.function == "student_quantile") {
      // 1 - p costs up to half a unit of 1 in the tail, 1e-16 / 1e-5; lgamma of 5e4 leaves 1e-11.
      EXPECT_NEAR(student_quantile(row.argument, row.dof) / row.value, 1.0, 2e-10);
    } else {
      ASSERT_EQ(row.function, "chi_square_tail");
      // The front factor exp(a ln z - z - lgamma a) holds terms up to 1400, each rounded to 1e-16.
      EXPECT_NEAR(chi_square_tail(row.argument, row.dof), row.value, 1e-12 * row.value + 1e-15);
    }
  }
  EXPECT_EQ(checked["normal_quantile"], 10);
  EXPECT_EQ(checked["student_quantile"], 70);
  EXPECT_EQ(checked["chi_square_tail"], 38);
}

// Cauchy's and the two-degree distribution have closed quantiles; chi-square with 2 is exponential.
TEST(Distributions, EqualTheirClosedForms) {
  for (const double p : {0.001, 0.2, 0.5, 0.9, 0.999}) {
    const double cauchy = -1.0 / std::tan(kPi * p);
    EXPECT_NEAR(student_quantile(p, 1.0), cauchy, 1e-11 * std::max(1.0, std::abs(cauchy)));
    const double two = (2.0 * p - 1.0) / std::sqrt(2.0 * p * (1.0 - p));
    EXPECT_NEAR(student_quantile(p, 2.0), two, 1e-11 * std::max(1.0, std::abs(two)));
  }
  for (const double x : {0.1, 1.0, 3.0, 30.0}) {
    EXPECT_NEAR(chi_square_tail(x, 2.0) / std::exp(-0.5 * x), 1.0, 1e-13);
  }
}

TEST(Distributions, AreOddAndMonotone) {
  double last = -std::numeric_limits<double>::infinity();
  for (double p = 0.001; p < 1.0; p += 0.001) {
    const double z = normal_quantile(p);
    EXPECT_GT(z, last);
    last = z;
    EXPECT_NEAR(normal_quantile(1.0 - p), -z, 1e-12);  // 1 - p is rounded
  }
  EXPECT_EQ(normal_quantile(0.5), 0.0);
  EXPECT_EQ(student_quantile(0.5, 3.0), 0.0);
}

TEST(Distributions, RefuseWhatIsNoProbability) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double p : {0.0, 1.0, -0.1, 1.1, nan}) {
    EXPECT_THROW(normal_quantile(p), Error);
    EXPECT_THROW(student_quantile(p, 3.0), Error);
  }
  for (const double dof : {0.0, -1.0, nan}) {
    EXPECT_THROW(student_quantile(0.9, dof), Error);
    EXPECT_THROW(chi_square_tail(1.0, dof), Error);
  }
  EXPECT_EQ(chi_square_tail(-1.0, 3.0), 1.0);
  EXPECT_EQ(chi_square_tail(0.0, 3.0), 1.0);
  EXPECT_TRUE(std::isnan(chi_square_tail(nan, 3.0)));
}

TEST(Distributions, AnInfiniteArgumentHasNoTail) {
  EXPECT_EQ(chi_square_tail(std::numeric_limits<double>::infinity(), 3.0), 0.0);
  EXPECT_EQ(chi_square_tail(1e6, 3.0), 0.0);  // below the smallest double
}

// numpy.quantile([3, 1, 4, 1, 5, 9, 2, 6], ...) by its definition: (n - 1) p between order values.
TEST(SampleQuantile, InterpolatesBetweenOrderValues) {
  const std::vector<double> sample = {3, 1, 4, 1, 5, 9, 2, 6};  // sorted 1 1 2 3 4 5 6 9
  EXPECT_EQ(sample_quantile(sample, 0.0), 1.0);
  EXPECT_EQ(sample_quantile(sample, 1.0), 9.0);
  EXPECT_EQ(sample_quantile(sample, 0.5), 3.5);
  EXPECT_DOUBLE_EQ(sample_quantile(sample, 0.25), 1.75);
  EXPECT_DOUBLE_EQ(sample_quantile(sample, 0.9), 6.9);
  EXPECT_EQ(sample_quantile({7.0}, 0.3), 7.0);
}

TEST(SampleQuantile, LeavesOutWhatIsNoNumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(sample_quantile({nan, 1.0, nan, 2.0, 3.0}, 0.5), 2.0);
  EXPECT_TRUE(std::isnan(sample_quantile({nan, nan}, 0.5)));
  EXPECT_TRUE(std::isnan(sample_quantile({}, 0.5)));
}

}  // namespace
}  // namespace ulna
