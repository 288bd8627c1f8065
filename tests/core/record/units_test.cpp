#include "record/units.hpp"

#include <gtest/gtest.h>

#include "base/types.hpp"

namespace ulna {
namespace {

TEST(Units, KnowsTheLaboratorysSpellings) {
  struct Case {
    const char* text;
    const char* si;
    double factor;
  };
  for (const Case& c :
       {Case{"mm", "m", 1e-3}, Case{" cm ", "m", 1e-2}, Case{"\xC2\xB5m", "m", 1e-6},
        Case{"deg", "rad", kPi / 180}, Case{"\xC2\xB0", "rad", kPi / 180},
        Case{"mrad", "rad", 1e-3}, Case{"N*m", "Nm", 1.0}, Case{"N\xC2\xB7m", "Nm", 1.0},
        Case{"N m", "Nm", 1.0}, Case{"mNm", "Nm", 1e-3}, Case{"Nmm", "Nm", 1e-3},
        Case{"kN", "N", 1e3}, Case{"m/s\xC2\xB2", "m/s^2", 1.0}, Case{"m/s2", "m/s^2", 1.0},
        Case{"m/s^2", "m/s^2", 1.0}, Case{"deg/s", "rad/s", kPi / 180}, Case{"us", "s", 1e-6},
        Case{"min", "s", 60.0}, Case{"%", "1", 0.01}}) {
    const auto unit = parse_unit(c.text);
    ASSERT_TRUE(unit.has_value()) << c.text;
    EXPECT_EQ(unit->si, c.si) << c.text;
    EXPECT_EQ(unit->factor, c.factor) << c.text;
  }
  for (const char* text :
       {"", "furlong", "M", "n", "Newton metre of the kind that is too long to be one"}) {
    EXPECT_FALSE(parse_unit(text).has_value()) << text;
  }
}

TEST(Units, TakesHeadingsApart) {
  struct Case {
    const char* text;
    const char* stem;
    const char* unit;
  };
  for (const Case& c :
       {Case{"x [mm]", "x", "mm"}, Case{"x (mm)", "x", "mm"}, Case{"x_mm", "x", "mm"},
        Case{"time_s", "time", "s"}, Case{"torque_Nm", "torque", "Nm"},
        Case{"position_rad", "position", "rad"}, Case{"acc_x_m_s2", "acc_x", "m/s^2"},
        Case{"dq_hip_rad_s", "dq_hip", "rad/s"}, Case{"x (filtered)", "x (filtered)", ""},
        Case{"x [furlong]", "x", "furlong"}, Case{"F_x", "F_x", ""}, Case{"[mm]", "[mm]", ""},
        Case{"_m", "_m", ""}, Case{"", "", ""}, Case{"x []", "x", ""}}) {
    const Heading heading = parse_heading(c.text);
    EXPECT_EQ(heading.stem, c.stem) << c.text;
    EXPECT_EQ(heading.unit, c.unit) << c.text;
  }
}

}  // namespace
}  // namespace ulna
