// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/header_units.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

TEST(HeaderUnits, OnlyUnitsAreCutOff) {
  EXPECT_EQ(without_unit("ch0 [rad]"), "ch0");
  EXPECT_EQ(without_unit("t[ms]"), "t");
  EXPECT_EQ(without_unit("speed (rad/s)"), "speed");
  for (const char* name : {"q[0]", "arm (left)", "[rad]", "rad]", "", "t [s", "t [s] "}) {
    EXPECT_EQ(without_unit(name), name);
  }
  EXPECT_EQ(header_factor("t [ms]"), 1e-3);
  EXPECT_EQ(header_factor("t [s]"), 1.0);
  EXPECT_EQ(header_factor("q[0]"), 1.0);
}

TEST(HeaderUnits, ATimeHasThemBehindAnUnderscoreToo) {
  EXPECT_EQ(without_unit("t_ms"), "t");
  EXPECT_EQ(header_factor("timestamp_ns"), 1e-9);
  EXPECT_EQ(without_unit("Time_s"), "Time");
  for (const char* name : {"q1_mm", "at_ms", "t_", "_ms", "time_zone", "time_left_s"}) {
    EXPECT_EQ(without_unit(name), name);
    EXPECT_EQ(header_factor(name), 1.0);
  }
}

TEST(HeaderUnits, NamesThatWouldBecomeAlikeKeepThem) {
  CsvTable table;
  table.header = {"t [s]", "q [deg]", "q [rad]", "tau (Nm)"};
  strip_units(table);
  EXPECT_EQ(table.header, (std::vector<std::string>{"t", "q [deg]", "q [rad]", "tau"}));
}

}  // namespace
}  // namespace kinescope
