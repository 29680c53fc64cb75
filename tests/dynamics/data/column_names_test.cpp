// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/column_names.h"

#include <numbers>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

using enum LoggedQuantity;
using enum LoggedOrigin;

struct Case {
  const char* name;
  LoggedQuantity quantity;
  LoggedOrigin origin;
  std::vector<std::string> joint;
  const char* unit;
};

TEST(ColumnNames, ReadsTheNamesInUse) {
  const std::vector<Case> cases = {
      {"q1", kPosition, kPlain, {"1"}, ""},
      {"q_1", kPosition, kPlain, {"1"}, ""},
      {"q[0]", kPosition, kPlain, {"0"}, ""},
      {"state.q[3]", kPosition, kPlain, {"3"}, ""},
      {"joint1_position", kPosition, kPlain, {"joint", "1"}, ""},
      {"jointPosition2", kPosition, kPlain, {"joint", "2"}, ""},
      {"q_arm_1", kPosition, kPlain, {"arm", "1"}, ""},
      {"q_deg6", kPosition, kPlain, {"6"}, "deg"},
      {"q_cmd3", kPosition, kCommanded, {"3"}, ""},
      {"state.q_d[3]", kPosition, kCommanded, {"3"}, ""},
      {"dq2", kVelocity, kPlain, {"2"}, ""},
      {"dq1_deg_s", kVelocity, kPlain, {"1"}, "deg"},
      {"dq_2_rad_per_s", kVelocity, kPlain, {"2"}, "rad"},
      {"ddq1_deg_s2", kAcceleration, kPlain, {"1"}, "deg"},
      {"dq_m_s_2", kVelocity, kPlain, {"m", "s", "2"}, ""},
      {"q_dot_2", kVelocity, kPlain, {"2"}, ""},
      {"actual_qd_0", kVelocity, kSensor, {"0"}, ""},
      {"joint_3_velocity", kVelocity, kPlain, {"joint", "3"}, ""},
      {"ddq7", kAcceleration, kPlain, {"7"}, ""},
      {"q_ddot_2", kAcceleration, kPlain, {"2"}, ""},
      {"tau4", kTorque, kPlain, {"4"}, ""},
      {"state.tau_J[2]", kTorque, kPlain, {"2"}, ""},
      {"tau_cmd1", kTorque, kCommanded, {"1"}, ""},
      {"tau_des6", kTorque, kCommanded, {"6"}, ""},
      {"tau_sensor", kTorque, kSensor, {}, ""},
      {"tau_friction_est", kTorque, kComputed, {}, ""},
      {"tau_rigid_model2", kTorque, kComputed, {"2"}, ""},
      {"torque_enable", kTorque, kComputed, {}, ""},
      {"effort_torso_lift", kTorque, kPlain, {"torso", "lift"}, ""},
      {"i1", kCurrent, kPlain, {"1"}, ""},
      {"i_des1", kCurrent, kCommanded, {"1"}, ""},
      {"i_tool", kCurrent, kComputed, {}, ""},
      {"actual_current_5", kCurrent, kSensor, {"5"}, ""},
      {"current_mA", kCurrent, kPlain, {}, "mA"},
      {"torque_percent1", kTorque, kPlain, {"1"}, "%"},
      {"effort_pct_arm_2", kTorque, kPlain, {"arm", "2"}, "%"},
      {"q_pct", kPosition, kPlain, {"pct"}, ""},
      {"t", kTime, kPlain, {}, ""},
      {"t_ms", kTime, kPlain, {}, "ms"},
      {"t_s", kTime, kPlain, {}, "s"},
      {"timestamp", kTime, kPlain, {}, ""},
      {"rec", kTrajectory, kPlain, {}, ""},
      {"run", kTrajectory, kPlain, {}, ""},
  };
  for (const Case& expected : cases) {
    const auto found = read_column_name(expected.name);
    ASSERT_TRUE(found) << expected.name;
    EXPECT_EQ(found->quantity, expected.quantity) << expected.name;
    EXPECT_EQ(found->origin, expected.origin) << expected.name;
    EXPECT_EQ(found->joint, expected.joint) << expected.name;
    EXPECT_EQ(found->unit, expected.unit) << expected.name;
  }
}

TEST(ColumnNames, PassesOverWhatIsNoJointSignal) {
  for (const char* name : {"px_mm", "Fx", "Tx", "temp1", "Tmos1", "label", "volts", "latency_ms",
                           "g1", "cycle", "grip_lost", "T1", "t1", "run_3_note"}) {
    EXPECT_FALSE(read_column_name(name)) << name;
  }
}

TEST(ColumnNames, UnitsHaveFactors) {
  EXPECT_DOUBLE_EQ(*unit_factor("deg"), std::numbers::pi / 180.0);
  EXPECT_DOUBLE_EQ(*unit_factor("mm/s"), 1e-3);
  EXPECT_DOUBLE_EQ(*unit_factor("us"), 1e-6);
  EXPECT_DOUBLE_EQ(*unit_factor("kNm"), 1e3);
  EXPECT_FALSE(unit_factor("parsec"));
}

}  // namespace
}  // namespace kinescope
