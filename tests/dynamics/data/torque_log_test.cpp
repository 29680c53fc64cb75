// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/torque_log.h"

#include <numbers>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "tests/dynamics/data/log_world.h"

namespace kinescope {
namespace {

const std::vector<WantedJoint> kTwo = {{"shoulder", false}, {"elbow", false}};

ReadTorqueLog read(const std::string& text, const LogMapping& mapping = {},
                   const std::vector<WantedJoint>& wanted = {}, bool torque_required = true) {
  return to_torque_log(parse_channel_table(text, "run.csv"), mapping, wanted, torque_required);
}

std::string refusal(const std::string& text, const LogMapping& mapping = {},
                    const std::vector<WantedJoint>& wanted = {}) {
  return refusal_of([&] { static_cast<void>(read(text, mapping, wanted)); });
}

TEST(TorqueLog, TakesJointsByNameInTheTreesOrder) {
  const auto found = read(
      "elbow_torque,t,shoulder_position,elbow_position,shoulder_torque\n"
      "4,0,1,2,3\n40,0.1,10,20,30\n",
      {}, kTwo);
  EXPECT_TRUE(found.findings.empty());
  EXPECT_EQ(found.log.q.row(1), Eigen::RowVector2d(10, 20));
  EXPECT_EQ(found.log.torque.row(0), Eigen::RowVector2d(3, 4));
  EXPECT_EQ(found.log.q_columns, (std::vector<std::string>{"shoulder_position", "elbow_position"}));
  EXPECT_EQ(found.log.dq.cols(), 0);
  EXPECT_EQ(found.log.torque_unit, "Nm");
}

TEST(TorqueLog, TakesJointsByNumberAlsoCountedFromZero) {
  const std::vector<WantedJoint> wanted = {{"panda_joint2", false}, {"panda_joint1", false}};
  EXPECT_EQ(read("t,q1,q2,tau1,tau2\n0,1,2,3,4\n", {}, wanted).log.q.row(0),
            Eigen::RowVector2d(2, 1));
  EXPECT_EQ(read("t,q[0],q[1],tau[0],tau[1]\n0,1,2,3,4\n", {}, wanted).log.q.row(0),
            Eigen::RowVector2d(2, 1));
}

TEST(TorqueLog, SaysWhenOnlyTheOrderIsLeft) {
  const auto found = read("t,q1,q2,tau1,tau2\n0,1,2,3,4\n", {}, kTwo);
  EXPECT_EQ(found.log.q.row(0), Eigen::RowVector2d(1, 2));
  ASSERT_EQ(found.findings.size(), 1U);
  EXPECT_EQ(found.findings[0].fault, LogFault::kAssignment);
  EXPECT_NE(found.findings[0].what.find("shoulder = 1, elbow = 2"), std::string::npos);
}

TEST(TorqueLog, NamesBothListsWhereJointsDoNotMatch) {
  EXPECT_EQ(
      refusal("t,q_hip,q_knee,tau_hip,tau_knee\n0,1,2,3,4\n", {}, kTwo),
      "run.csv:1: the log's joints (hip, knee) are not the tree's (shoulder, elbow) (say which is "
      "which in recording.yaml, dynamics: {joints: {shoulder: hip}})");
  EXPECT_NE(refusal("t,q1,q2,q3,tau1,tau2,tau3\n0,1,2,3,4,5,6\n", {}, kTwo).find("(1, 2, 3)"),
            std::string::npos);
  LogMapping mapping;
  mapping.joints = {{"shoulder", "knee"}, {"elbow", "hip"}};
  EXPECT_EQ(read("t,q_hip,q_knee,tau_hip,tau_knee\n0,1,2,3,4\n", mapping, kTwo).log.q.row(0),
            Eigen::RowVector2d(2, 1));
}

TEST(TorqueLog, PrefersMeasuredTorqueThenCurrentThenCommand) {
  EXPECT_EQ(read("t,q1,tau_cmd1,tau_sensor1,tau1\n0,1,2,3,4\n").log.torque(0, 0), 3.0);
  const auto current = read("t,q1,i1,i_des1,tau_des1\n0,1,2,3,4\n");
  EXPECT_EQ(current.log.torque(0, 0), 2.0);
  EXPECT_EQ(current.log.torque_unit, "A");
  const auto command = read("t,q1,tau_cmd1\n0,1,2\n");
  EXPECT_EQ(findings_of(command.findings, LogFault::kCommanded).size(), 1U);
}

TEST(TorqueLog, ConvertsUnitsSaidByNamesOrMapping) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  const auto named = read("t_ms,q_deg1,current_mA1\n500,180,2000\n");
  EXPECT_DOUBLE_EQ(named.log.t_s(0), 0.5);
  EXPECT_DOUBLE_EQ(named.log.q(0, 0), std::numbers::pi);
  EXPECT_DOUBLE_EQ(named.log.torque(0, 0), 2.0);
  EXPECT_TRUE(named.log.position_unit_declared && named.log.time_unit_declared);
  LogMapping mapping;
  mapping.time = "clock";
  mapping.time_unit = "us";
  mapping.position = {"b", "a"};
  mapping.torque = {"m*"};
  mapping.velocity = {"vb", "va"};
  mapping.position_unit = {"mm", "deg"};
  mapping.velocity_unit = {"mm/s", "deg/s"};
  mapping.position_factor = {-1.0, 0.5};
  mapping.torque_factor = {10.0};
  mapping.torque_unit = {"A"};
  const auto mapped = read("clock,a,b,va,vb,m1,m2\n2e6,90,30,20,10,1,2\n", mapping, kTwo);
  EXPECT_DOUBLE_EQ(mapped.log.t_s(0), 2.0);
  EXPECT_DOUBLE_EQ(mapped.log.q(0, 0), -0.03);
  EXPECT_DOUBLE_EQ(mapped.log.q(0, 1), 45.0 * kDegree);
  EXPECT_DOUBLE_EQ(mapped.log.dq(0, 0), -0.01);
  EXPECT_DOUBLE_EQ(mapped.log.dq(0, 1), 10.0 * kDegree);
  EXPECT_EQ(mapped.log.torque.row(0), Eigen::RowVector2d(10, 20));
  EXPECT_EQ(mapped.log.torque_unit, "Nm") << "currents with a gain are torques";
}

TEST(TorqueLog, RefusesPercentOfARatedTorqueUnlessItIsStated) {
  const char* const text = "t,q1,torque_percent1\n0,1,40\n1,1,60\n";
  const auto units = findings_of(read(text).findings, LogFault::kUnit);
  ASSERT_EQ(units.size(), 1U);
  EXPECT_EQ(units[0].weight, FaultWeight::kRefusal);
  EXPECT_NE(to_line(units[0]).find("(torque_percent1) are in percent of a rated torque"),
            std::string::npos);
  EXPECT_NE(units[0].remedy.find("torque_factor"), std::string::npos);
  LogMapping rated;
  rated.torque_factor = {0.5};
  const auto mapped = read(text, rated);
  EXPECT_TRUE(findings_of(mapped.findings, LogFault::kUnit).empty());
  EXPECT_EQ(mapped.log.torque.col(0), Eigen::Vector2d(20, 30));
  EXPECT_EQ(mapped.log.torque_unit, "Nm");
  LogMapping newton_metres;  // whatever the name says
  newton_metres.torque_unit = {"Nm"};
  EXPECT_TRUE(findings_of(read(text, newton_metres).findings, LogFault::kUnit).empty());
}

TEST(TorqueLog, ReadsTrajectoriesFromNumbersAndWords) {
  const auto numbers = read("rec,t,q1,tau1\n3,0,1,1\n3,1,1,1\n7,0,1,1\n3,0,1,1\n");
  EXPECT_EQ(numbers.log.trajectory, Eigen::Vector4i(0, 0, 1, 2));
  EXPECT_EQ(numbers.log.trajectory_names, (std::vector<std::string>{"3", "7", "3"}));
  LogMapping mapping;
  mapping.trajectory = "kind";
  const auto words = read("kind,t,q1,tau1\nlift,0,1,1\ndrop,1,1,1\n", mapping);
  EXPECT_EQ(words.log.trajectory_names, (std::vector<std::string>{"lift", "drop"}));
}

TEST(TorqueLog, TakesTheStatedRateWhereThereIsNoClock) {
  LogMapping mapping;
  mapping.rate_hz = 500.0;
  const auto found = read("q1,tau1\n1,1\n2,2\n3,3\n", mapping);
  EXPECT_DOUBLE_EQ(found.log.t_s(2), 0.004);
  EXPECT_FALSE(found.log.stamped);
}

TEST(TorqueLog, RefusesWithPlaceAndRemedy) {
  EXPECT_NE(refusal("t,label,e1\n0,1,1\n")
                .find("run.csv:1: no joint positions among the columns t, "
                      "label, e1"),
            std::string::npos);
  EXPECT_NE(refusal("t,q1,dq1\n0,1,1\n").find("no joint torques or currents"), std::string::npos);
  EXPECT_EQ(read("t,q1,dq1\n0,1,1\n", {}, {}, false).log.torque.cols(), 0);
  LogMapping missing;
  missing.torque = {"m*"};
  EXPECT_NE(refusal("t,q1,tau1\n0,1,1\n", missing).find("no column 'm*' for the torque"),
            std::string::npos);
  LogMapping unit;
  unit.position_unit = {"furlong"};
  EXPECT_NE(refusal("t,q1,tau1\n0,1,1\n", unit).find("unknown unit 'furlong'"), std::string::npos);
  LogMapping length;
  length.torque_factor = {1.0, 2.0};
  EXPECT_NE(
      refusal("t,q1,q2,q3,tau1,tau2,tau3\n0,1,1,1,1,1,1\n", length).find("2 entries for 3 joints"),
      std::string::npos);
  LogMapping time;
  time.time = "when";
  EXPECT_NE(refusal("t,q1,tau1\n0,1,1\n", time).find("no column 'when'"), std::string::npos);
  EXPECT_NE(refusal("t,q1,tau1\n0,1,1\n0.1,one,2\n0.2,2,2\n0.3,2,2\n")
                .find("run.csv:3: column 'q1' holds 'one'"),
            std::string::npos);
}

TEST(TorqueLog, DerivesWhatIsNotThereForAllJoints) {
  const auto found = read("t,q1,q2,dq1,tau1,tau2\n0,1,2,3,4,5\n");
  EXPECT_EQ(found.log.dq.cols(), 0);
  EXPECT_EQ(findings_of(found.findings, LogFault::kAssignment).size(), 1U);
}

TEST(TorqueLog, JoinsFilesAndRefusesDifferentOnes) {
  const TorqueLog a = read("t,q1,tau1\n0,1,1\n1,1,1\n").log;
  const TorqueLog b = read("t,q1,dq1,tau1\n0,1,1,1\n").log;
  const TorqueLog both = join({a, a});
  EXPECT_EQ(both.trajectory, Eigen::Vector4i(0, 0, 1, 1));
  EXPECT_EQ(both.place(3), "run.csv:3");
  EXPECT_NE(refusal_of([&] { static_cast<void>(join({a, b})); }).find("same signals"),
            std::string::npos);
}

TEST(TorqueLog, TrajectoriesOfSeveralFilesAreNamedWithTheirFile) {
  const TorqueLog a = read("t,q1,tau1\n0,1,1\n1,1,1\n").log;
  TorqueLog b = a;
  b.sources = {"night/run.csv"};
  TorqueLog numbered = a;
  numbered.sources = {"day/other.csv"};
  numbered.trajectory_names = {"7"};
  EXPECT_EQ(join({a}).trajectory_names, (std::vector<std::string>{"run.csv"}));
  EXPECT_EQ(join({a, b, numbered}).trajectory_names,
            (std::vector<std::string>{"run.csv", "night/run.csv", "other.csv: 7"}));
}

}  // namespace
}  // namespace kinescope
