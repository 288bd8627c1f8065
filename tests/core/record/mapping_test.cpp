#include "record/mapping.hpp"

#include "record/units.hpp"
#include "text.hpp"

namespace ulna {
namespace {

Mapping map_of(const std::vector<std::string>& headings, MappingRules rules = {}) {
  std::vector<Column> columns;
  for (const std::string& text : headings) {
    const Heading heading = parse_heading(text);
    columns.push_back({text, heading.stem, heading.unit});
  }
  return map_columns(columns, rules);
}

// "name:role axis" of every channel, roles by first letter.
std::string outline(const Mapping& mapping) {
  std::string text = mapping.time < 0 ? "-" : "t" + std::to_string(mapping.time);
  for (const Channel& c : mapping.channels) {
    text += " " + c.name + ":" + "opfr"[static_cast<int>(c.role)] +
            (c.role == Role::kOther ? "" : std::to_string(c.axis));
  }
  return text;
}

TEST(Mapping, GuessesTheNamesLabsUse) {
  EXPECT_EQ(outline(map_of({"time_s", "position_rad", "torque_Nm"})), "t0 position:p0 torque:f0");
  EXPECT_EQ(outline(map_of({"t", "x", "y", "Fx", "Fy"})), "t0 x:p0 y:p1 F_x:f0 F_y:f1");
  EXPECT_EQ(outline(map_of({"time", "x_m", "y_m", "F_x_N", "F_y_N", "x_ref_m", "y_ref_m"})),
            "t0 x:p0 y:p1 F_x:f0 F_y:f1 x_ref:r0 y_ref:r1");
  EXPECT_EQ(outline(map_of({"Time [ms]", "pos_x [mm]", "pos_y [mm]", "force_x [N]", "force_y [N]",
                            "ref_x [mm]"})),
            "t0 x:p0 y:p1 F_x:f0 F_y:f1 x_ref:r0");
  EXPECT_EQ(outline(map_of({"hand_x", "hand_y", "fx", "fy", "x_des", "y_cmd", "Time"})),
            "t6 x:p0 y:p1 F_x:f0 F_y:f1 x_ref:r0 y_ref:r1");
  EXPECT_EQ(outline(map_of({"t", "q1", "q2", "tau1", "tau2"})),
            "t0 q_1:p0 q_2:p1 torque_1:f0 torque_2:f1");
  EXPECT_EQ(outline(map_of({"t", "q_1_deg", "tau_1_Nm", "dq_1_deg_s"})),
            "t0 q_1:p0 torque_1:f0 dq_1:o");
  EXPECT_EQ(outline(map_of({"t", "position", "force", "reference"})),
            "t0 position:p0 F_x:f0 x_ref:r0");
  EXPECT_EQ(outline(map_of({"t", "x", "force"})), "t0 x:p0 F_x:f0");
  EXPECT_EQ(outline(map_of({"t", "positionX", "ForceX", "vx", "emg_1"})),
            "t0 x:p0 F_x:f0 vx:o emg_1:o");
  EXPECT_EQ(outline(map_of({"t", "angle_deg", "M"})), "t0 angle:p0 torque:f0");
}

TEST(Mapping, KeepsWhatDoesNotBelongAside) {
  // A six-axis sensor on a planar robot.
  EXPECT_EQ(outline(map_of({"t", "x", "y", "Fx_N", "Fy_N", "Fz_N", "Mx_Nm", "My_Nm", "Mz_Nm"})),
            "t0 x:p0 y:p1 F_x:f0 F_y:f1 F_z:o torque_x:o torque_y:o torque_z:o");
  // A sagittal plane: the second axis is z.
  EXPECT_EQ(outline(map_of({"t", "x", "z", "F_z", "F_x"})), "t0 x:p0 z:p1 F_z:f1 F_x:f0");
  EXPECT_EQ(outline(map_of({"time_s", "q_ankle_rad", "q_hip_rad", "dq_ankle_rad_s", "acc_x_m_s2",
                            "foot_fx_N"})),
            "t0 q_ankle:p0 q_hip:p1 dq_ankle:o acc_x:o foot_fx:o");
  const Mapping twice = map_of({"t", "x", "pos_x", "F_x"});
  EXPECT_EQ(outline(twice), "t0 x:p0 pos_x:o F_x:f0");
  EXPECT_TRUE(has(twice.findings, "role", "pos_x"));
}

TEST(Mapping, SaysWhatItAssumes) {
  const Mapping mapping = map_of({"t", "x", "F_x [V]"});
  EXPECT_TRUE(has(mapping.findings, "unit_missing", "x"));
  EXPECT_EQ(mapping.channels[0].unit, "m");
  const Mapping bare = map_of({"t", "position", "torque"});
  EXPECT_EQ(bare.channels[0].unit, "rad");
  EXPECT_EQ(bare.channels[1].unit, "Nm");
}

TEST(Mapping, ConvertsUnits) {
  const Mapping mapping = map_of({"t_ms", "x_mm", "F_x [kN]", "temperature [K]"});
  EXPECT_EQ(mapping.time_factor, 1e-3);
  EXPECT_EQ(mapping.factors[0], 1e-3);
  EXPECT_EQ(mapping.factors[1], 1e3);
  EXPECT_EQ(mapping.factors[2], 1.0);
  EXPECT_EQ(mapping.channels[2].unit, "K");
  EXPECT_TRUE(has(mapping.findings, "unit_unknown", "temperature"));
}

TEST(Mapping, FollowsRules) {
  MappingRules rules;
  rules.time_column = "clock";
  rules.time_unit = "ms";
  ChannelRule force;
  force.source = "Fx_raw";
  force.name = "F_x";
  force.unit = "kN";
  force.sign = -1;
  force.frame = "base";
  ChannelRule position;
  position.source = "enc";
  position.name = "x";
  position.role = Role::kPosition;
  position.unit = "mm";
  rules.channels = {force, position};
  const Mapping mapping = map_of({"clock", "enc", "Fx_raw", "F_x", "extra"}, rules);
  EXPECT_EQ(outline(mapping), "t0 F_x:f0 x:p0 F_x_other:o extra:o");
  EXPECT_EQ(mapping.factors[0], -1e3);
  EXPECT_EQ(mapping.channels[0].sign, -1);
  EXPECT_EQ(mapping.channels[0].frame, "base");
  EXPECT_EQ(mapping.time_factor, 1e-3);
}

TEST(Mapping, NamesTheNearestColumn) {
  MappingRules rules;
  ChannelRule rule;
  rule.source = "Fx_row";
  rules.channels = {rule};
  try {
    map_of({"t", "Fx_raw", "x"}, rules);
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(
        error.what(),
        "there is no column \"Fx_row\" (did you mean \"Fx_raw\"?); the columns are t, Fx_raw, x");
    EXPECT_EQ(error.fault(), Fault::kArgument);
  }
}

TEST(Mapping, RefusesContradictions) {
  ChannelRule a, b;
  a.source = "x";
  a.name = "same";
  b.source = "y";
  b.name = "same";
  MappingRules rules;
  rules.channels = {a, b};
  EXPECT_THROW(map_of({"t", "x", "y"}, rules), Error);
  b = a;
  b.name = "other";
  rules.channels = {a, b};
  EXPECT_THROW(map_of({"t", "x", "y"}, rules), Error);
  a.unit = "furlong";
  rules.channels = {a};
  try {
    map_of({"t", "x", "y"}, rules);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("\"x\" has the unknown unit \"furlong\""),
              std::string::npos);
  }
  a.unit.clear();
  a.sign = 2;
  rules.channels = {a};
  EXPECT_THROW(map_of({"t", "x", "y"}, rules), Error);
}

}  // namespace
}  // namespace ulna
