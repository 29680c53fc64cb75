// SPDX-License-Identifier: Apache-2.0
//
// Logs that tell every joint twice, as read and as commanded, through the whole program.
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/file.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/model/kinematic_tree.h"
#include "tests/app/commands/poses_of_arm.h"
#include "tests/app/commands/program.h"

namespace kinescope {
namespace {

using nlohmann::json;

RecordingOptions exact() {
  RecordingOptions out;
  out.sigma_m = 3e-5;
  out.sigma_rad = 0.01 * kRadPerDegree;
  return out;
}

// `command` of a joint's reading at a row.
template <typename Command>
JointLog with_commands(JointLog log, const Command& command) {
  const JointLog read = log;
  const Eigen::Index joints = log.values.cols();
  log.values.conservativeResize(Eigen::NoChange, 2 * joints);
  for (Eigen::Index j = 0; j < joints; ++j) {
    log.channels.push_back(log.channels[static_cast<std::size_t>(j)] + "_cmd");
    for (Eigen::Index i = 0; i < log.values.rows(); ++i)
      log.values(i, joints + j) = command(read, i, static_cast<int>(j));
  }
  return log;
}

class SecondColumns : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  Outcome calibrate(const RobotRecording& recording) const {
    write_poses(recording, folder_);
    return run({"run", folder_.path().string(), "--output", path("out"), "--quiet"});
  }
  [[nodiscard]] json product(const std::string& name) const {
    return json::parse(read_text_file(folder_.path() / "out" / name));
  }
  RecordingFolder folder_;
};

TEST_F(SecondColumns, HowCommandsDifferIsSaid) {
  constexpr double kAhead = 0.06;  // s
  PosesOfArm two = arm("commanded", exact());
  two.recording.log =
      with_commands(std::move(two.recording.log), [](const JointLog& log, Eigen::Index i, int j) {
        const auto later = interpolate(log, j, log.times_s[static_cast<std::size_t>(i)] + kAhead);
        return later ? later->value : log.values(i, j);
      });
  const Outcome done = calibrate(two.recording);
  EXPECT_EQ(done.code, 0) << done.err;
  EXPECT_NE(done.out.find("ms ahead of"), std::string::npos) << done.out;
  const json columns = product("result.json").at("data").at("second_columns");
  ASSERT_EQ(columns.size(), two.channel.size());
  for (const json& column : columns) {
    EXPECT_EQ(column.at("column"), column.at("of").get<std::string>() + "_cmd");
    ASSERT_EQ(column.at("effects").size(), 1U) << column.dump();
    EXPECT_EQ(column.at("effects")[0].at("effect"), "time_offset");
    EXPECT_NEAR(column.at("effects")[0].at("size").get<double>(), kAhead, 1e-3);
  }
}

// The joints stand four fifths of the way from what is read to what is commanded.
TEST_F(SecondColumns, ReadingsBeforeAJointHasComeToRestAreCorrected) {
  constexpr double kShare = 0.8;
  constexpr double kLeft = 0.3 * kRadPerDegree;
  PosesOfArm early = arm("read early", exact());
  const JointLog truth = early.recording.log;
  JointLog& log = early.recording.log;
  Eigen::MatrixXd left(log.values.rows(), log.values.cols());
  for (Eigen::Index j = 0; j < left.cols(); ++j) {
    const double rate = 2.1 + 0.4 * static_cast<double>(j);  // rad/s, no joint's own
    for (Eigen::Index i = 0; i < left.rows(); ++i)
      left(i, j) = kLeft * std::sin(rate * log.times_s[static_cast<std::size_t>(i)]);
  }
  log.values -= kShare * left;
  log = with_commands(std::move(log), [&](const JointLog& read, Eigen::Index i, int j) {
    return read.values(i, j) + left(i, j);
  });
  const Outcome done = calibrate(early.recording);
  EXPECT_EQ(done.code, 0) << done.err;
  EXPECT_NE(done.out.find("early_reading"), std::string::npos) << done.out;
  EXPECT_EQ(product("calibration.json").at("effects")[0].at("effect"), "early_reading");

  const std::vector<std::string> correct{"correct", path("out"), path("joints.csv"), "--output",
                                         path("corrected.csv")};
  EXPECT_EQ(run(correct).code, 0);
  const JointLog corrected = read_joint_log(folder_.path() / "corrected.csv");
  const json joints = product("calibration.json").at("robot").at("joints");
  ASSERT_EQ(joints.size(), early.channel.size());
  for (const json& joint : joints) {
    const std::string channel = joint.at("channel");
    const std::string own = channel.substr(0, channel.find("_cmd"));
    const Eigen::VectorXd miss = corrected.values.col(value_of(corrected.channel(channel))) -
                                 truth.values.col(value_of(truth.channel(own)));
    EXPECT_LT(std::sqrt(miss.squaredNorm() / static_cast<double>(miss.size())), 0.1 * kLeft) << own;
  }

  // Without the commands there is nothing to correct by.
  folder_.write("read_only.csv", joints_csv(truth));
  expect_refusal({"correct", path("out"), path("read_only.csv"), "--output", path("none.csv")},
                 ExitCode::kBadInput, "no column");
}

}  // namespace
}  // namespace kinescope
