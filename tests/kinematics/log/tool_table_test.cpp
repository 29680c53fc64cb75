// SPDX-License-Identifier: Apache-2.0
//
// Logs as other tools export them.
#include "kinematics/log/tool_table.h"

#include <gtest/gtest.h>

#include "kinematics/core/date_time.h"
#include "kinematics/core/error.h"
#include "kinematics/log/channel_table.h"
#include "kinematics/log/joint_log_table.h"

namespace kinescope {
namespace {

struct ToolLog {
  JointLog log;
  std::vector<std::string> said;
};

ToolLog read_tool(std::string_view text) {
  CsvTable table = parse_csv(text, "joints.csv");
  std::vector<std::string> said = make_time_plain(table);
  return {joint_log_of(with_log_names(std::move(table))).log, std::move(said)};
}

TEST(ToolTable, PlotJuggler) {
  const ToolLog plot = read_tool(
      "__time,/joint_states/pan/position,/joint_states/lift/position,/joint_states/pan/velocity,"
      "/joint_states/pan/effort\n1718000000.25,1,2,9,5\n1718000000.35,3,4,9,6\n");
  EXPECT_EQ(plot.log.channels, (std::vector<std::string>{"pan", "lift"}));
  EXPECT_EQ(plot.log.torque_columns, (std::vector<std::string>{"tau_pan"}));
  EXPECT_EQ(plot.log.times_s.front(), 1718000000.25);
  EXPECT_EQ(plot.said, (std::vector<std::string>{"joints.csv: the time is '__time' (s)"}));
  const ToolLog two = read_tool("__time,/left/a/position,/right/a/position\n0,1,2\n1,2,3\n");
  EXPECT_EQ(two.log.channels, (std::vector<std::string>{"/left/a/position", "/right/a/position"}));
}

TEST(ToolTable, RostopicEcho) {
  const std::string header =
      "%time,field.header.seq,field.header.stamp,field.name0,field.name1,"
      "field.position0,field.position1,field.velocity0\n";
  const ToolLog stamped = read_tool(header +
                                    "1718000000500000000,1,1718000000250000000,pan,lift,1,2,9\n"
                                    "1718000000600000000,2,1718000000350000000,pan,lift,3,4,9\n");
  EXPECT_EQ(stamped.log.channels, (std::vector<std::string>{"pan", "lift"}));
  EXPECT_NEAR(stamped.log.times_s.front(), 1718000000.25, 1e-6);
  EXPECT_NE(stamped.said.at(0).find("'field.header.stamp' (ns)"), std::string::npos);
  const ToolLog unstamped = read_tool(
      "%time,field.header.stamp,field.position0\n1000000000,0,1\n"
      "2000000000,0,2\n");
  EXPECT_EQ(unstamped.log.channels, (std::vector<std::string>{"joint0"}));
  EXPECT_EQ(unstamped.log.times_s, (std::vector<double>{1.0, 2.0}));
  EXPECT_NE(unstamped.said.at(0).find("'%time' (ns)"), std::string::npos);
}

TEST(ToolTable, SecondsBesideNanoseconds) {
  for (const char* header : {"header.stamp.sec,header.stamp.nanosec,header.seq,a\n",
                             "secs,nsecs,header.seq,a\n", "sec,nsec,header.seq,a\n"}) {
    const ToolLog both = read_tool(std::string(header) + "7,999000000,1,1\n8,1000000,2,2\n");
    EXPECT_EQ(both.log.channels, (std::vector<std::string>{"a"})) << header;
    EXPECT_EQ(both.log.times_s, (std::vector<double>{7.999, 8.001})) << header;
    EXPECT_NE(both.said.at(0).find("(ns)"), std::string::npos) << header;
  }
  // Seconds alone are no time that was said to be one.
  EXPECT_THROW(static_cast<void>(read_tool("sec,a\n0,1\n1,2\n")), Error);
}

TEST(ToolTable, TheIndexOfPandas) {
  const ToolLog rows = read_tool(",t,a\n0,0.5,1\n1,0.6,2\n");
  EXPECT_EQ(rows.log.channels, (std::vector<std::string>{"a"}));
  EXPECT_EQ(rows.log.times_s.front(), 0.5);
  EXPECT_TRUE(rows.said.empty());
  EXPECT_EQ(read_tool("Unnamed: 0,t,a\n0,0.5,1\n1,0.6,2\n").log.channels.size(), 1U);
  const ToolLog times = read_tool(",a\n0.5,1\n0.61,2\n");
  EXPECT_EQ(times.log.times_s, (std::vector<double>{0.5, 0.61}));
  EXPECT_NE(times.said.at(0).find("the first column, which has no name"), std::string::npos);
  EXPECT_THROW(static_cast<void>(read_tool(",t,a\n0.5,0,1\n0.7,1,2\n")), Error);
  EXPECT_THROW(static_cast<void>(read_tool(",a\n0,1\n1,2\n")), Error)
      << "rows are counted, not timed";
}

TEST(ToolTable, BlanksBetweenColumns) {
  const ToolLog rtde = read_tool("timestamp actual_q_0  actual_q_1\n0.5 1  2\n0.6  3 4\n");
  EXPECT_EQ(rtde.log.channels, (std::vector<std::string>{"actual_q_0", "actual_q_1"}));
  EXPECT_EQ(rtde.log.values(1, 1), 4.0);
  EXPECT_TRUE(rtde.said.empty());
}

// Velocities and currents of Universal Robots' exchange move with joints, and are none.
TEST(ToolTable, OfRtdeOnlyMeasuredPositionsAreChannels) {
  const std::string text =
      "timestamp,actual_q_0,actual_q_1,target_q_0,actual_qd_0,actual_current_0,speed_scaling,rail\n"
      "0,1,2,3,4,5,1,7\n1,2,3,4,5,6,1,8\n";
  EXPECT_EQ(read_tool(text).log.channels,
            (std::vector<std::string>{"actual_q_0", "actual_q_1", "rail"}));
  const CsvTable kept = with_log_names(parse_csv(text, "joints.csv"), {"actual_current_0"});
  EXPECT_TRUE(kept.column("actual_current_0"));
  EXPECT_FALSE(kept.column("actual_qd_0"));
  // Without them a target is all that is known of a joint.
  EXPECT_EQ(read_tool("t,target_q_0,actual_qd_0\n0,1,2\n1,2,3\n").log.channels,
            (std::vector<std::string>{"target_q_0", "actual_qd_0"}));
}

TEST(ToolTable, Dates) {
  const ToolLog dates =
      read_tool("timestamp,a\n2024-06-10 06:13:20.25,1\n2024-06-10 06:13:20.5,2\n");
  EXPECT_EQ(dates.log.times_s, (std::vector<double>{1718000000.25, 1718000000.5}));
  EXPECT_NE(dates.said.at(0).find("since 1970"), std::string::npos);
  EXPECT_EQ(parse_date_time("2024-06-10T08:13:20+02:00"), 1718000000.0);
  EXPECT_EQ(parse_date_time("2024-06-10T01:43:20.5-0430"), 1718000000.5);
  EXPECT_EQ(parse_date_time("1970-01-01T00:00:00Z"), 0.0);
  for (const char* text : {"", "2024-06-10", "06:13:20", "2024-13-10T06:13:20",
                           "2024-06-10T06:13:20.", "2024-06-10T06:13:20 x", "20240610T061320"})
    EXPECT_FALSE(parse_date_time(text)) << text;
}

TEST(ToolTable, TorqueLogsHaveTheTimeToo) {
  const ChannelTable table =
      parse_channel_table("secs,nsecs,q1,tau1\n1,500000000,2,3\n2,0,4,5\n", "log.csv");
  ASSERT_TRUE(table.column("t"));
  EXPECT_EQ(table.values(0, *table.column("t")), 1.5);
  EXPECT_EQ(table.warnings.size(), 1U);
}

}  // namespace
}  // namespace kinescope
