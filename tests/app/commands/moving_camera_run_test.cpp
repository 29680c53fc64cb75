// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/urdf.h"
#include "tests/truth/moving_camera_world.h"
#include "tests/truth/recorded_world.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using truth::CameraCarrier;
using truth::MovingCameraWorld;
using truth::RobotKind;

MovingCameraWorld filmed(CameraCarrier carrier, RobotKind kind = RobotKind::kArm3) {
  truth::MovingCameraOptions out;
  out.robot.seed = 7001;
  out.robot.kind = kind;
  out.robot.duration_s = 12.0;
  out.robot.tag_size_m = 0.06;
  out.robot.scale = 1.5;
  out.robot.distance_m = 1.6;
  out.carrier = carrier;
  if (carrier == CameraCarrier::kRobot) out.robot.amplitude_rad = 0.5;
  return truth::make_moving_camera_world(out);
}

struct Ran {
  int code = 0;
  std::string error;
  fs::path folder;
  [[nodiscard]] json read(const char* name) const {
    return json::parse(read_text_file(folder / name));
  }
  [[nodiscard]] std::string found() const {
    return read("result.json").at("verdict").at("found").get<std::string>();
  }
};

Ran ran_on(const MovingCameraWorld& world, const std::string& name, const std::string& settings) {
  const fs::path recording = truth::temporary_path("moving_camera") / name;
  truth::write_world(world.world, recording);
  if (!settings.empty()) write_file_atomically(recording / "recording.yaml", settings);
  RunOptions options;
  options.recording.folder = recording;
  options.output = recording.string() + "_run";
  Console console;
  console.quiet = true;
  Ran out{0, {}, options.output};
  try {
    out.code = static_cast<int>(run_command(options, console));
  } catch (const Error& error) {
    out.code = static_cast<int>(error.code());
    out.error = error.what();
  }
  return out;
}

// Rows of camera_optical_frame.tum, of `kinescope export`.
std::vector<std::vector<double>> exported_camera_path(const Ran& run) {
  const fs::path folder = run.folder.string() + "_tum";
  ExportOptions options;
  options.source = run.folder;
  options.tum = folder;
  options.force = true;
  EXPECT_EQ(export_command(options, Console{}), ExitCode::kDone);
  std::vector<std::vector<double>> out;
  std::ifstream file(folder / "camera_optical_frame.tum");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with('#')) continue;
    std::istringstream words(line);
    std::vector<double>& row = out.emplace_back();
    for (double value = 0.0; words >> value;) row.push_back(value);
    EXPECT_EQ(row.size(), 8U);
  }
  return out;
}

std::vector<std::string> joints_to(const KinematicTree& tree, const std::string& link) {
  std::vector<std::string> out;
  for (const JointId joint : tree.path_to(tree.link(link).value()))
    out.push_back(tree.joints[joint.index()].name);
  return out;
}

TEST(MovingCameraRun, OnTheRobotIsFoundByTheOrderOfTheColumns) {
  const Ran run = ran_on(filmed(CameraCarrier::kRobot), "hand", "");
  ASSERT_EQ(run.code, 0) << run.error;
  EXPECT_NE(run.found().find("taken to ride on the robot's last link"), std::string::npos);
  EXPECT_NE(run.found().find("camera_mount: fixed"), std::string::npos);
  const json motion = run.read("calibration.json").at("camera_motion");
  EXPECT_EQ(motion.at("camera_mount"), "hand");
  EXPECT_EQ(motion.at("link"), "link3");
  // The chain begins at the world and ends at the camera, by ROS's names.
  const KinematicTree tree = parse_urdf(read_text_file(run.folder / "robot.urdf"), "robot.urdf");
  EXPECT_EQ(joints_to(tree, "camera_optical_frame"),
            (std::vector<std::string>{"q1", "q2", "q3", "camera_joint", "camera_optical_joint"}));
  // Its path is that of the URDF's link.
  const auto path = exported_camera_path(run);
  const CsvTable values = read_csv(run.folder / "joint_values.csv");
  ASSERT_EQ(path.size(), values.rows.size());
  for (std::size_t row = 0; row < path.size(); row += 50) {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(std::ssize(tree.joints));
    for (const char* joint : {"q1", "q2", "q3"})
      q[tree.joint(joint).value().value] = values.number(row, values.require_column(joint));
    const Pose expected =
        forward_kinematics(tree, q)[tree.link("camera_optical_frame").value().index()];
    for (Eigen::Index i = 0; i < 3; ++i)
      EXPECT_NEAR(path[row][static_cast<std::size_t>(1 + i)], expected.translation[i], 1e-9);
  }
}

TEST(MovingCameraRun, CarriedIsFoundOut) {
  const Ran run = ran_on(filmed(CameraCarrier::kPerson), "carried", "");
  ASSERT_EQ(run.code, 0) << run.error;
  EXPECT_NE(run.found().find("A person carried the camera"), std::string::npos) << run.found();
  EXPECT_EQ(run.read("calibration.json").at("camera_motion").at("camera_mount"), "carried");
  const CsvTable stored = read_csv(run.folder / "camera_path.csv");
  const auto path = exported_camera_path(run);
  ASSERT_EQ(path.size(), stored.rows.size());
  for (std::size_t column = 0; column < 4; ++column)
    EXPECT_EQ(path[7][column], stored.number(7, column));
  const json calibration = run.read("calibration.json");
  std::vector<std::string> base;
  for (const json& marker : calibration.at("robot").at("markers"))
    if (marker.at("link") == "base") base.push_back(std::to_string(marker.at("id").get<int>()));
  EXPECT_EQ(base, (std::vector<std::string>{"10", "50", "51", "52", "53"}));
}

TEST(MovingCameraRun, RefusesWhatNeedsACameraAtRest) {
  const Ran gravity =
      ran_on(filmed(CameraCarrier::kRobot), "gravity", "camera_mount: hand\ngravity: [0, 1, 0]\n");
  EXPECT_EQ(gravity.code, 3);
  EXPECT_NE(gravity.error.find("gravity"), std::string::npos) << gravity.error;
  const Ran word = ran_on(filmed(CameraCarrier::kRobot), "word", "camera_mount: head\n");
  EXPECT_EQ(word.code, 3);
  EXPECT_NE(word.error.find("write hand, fixed or carried"), std::string::npos) << word.error;
  const Ran unseen =
      ran_on(filmed(CameraCarrier::kPerson), "unseen", "camera_mount: carried\nfixed_tags: [7]\n");
  EXPECT_EQ(unseen.code, 3);
  EXPECT_NE(unseen.error.find("fixed_tags names 7, which is not seen"), std::string::npos)
      << unseen.error;
}

}  // namespace
}  // namespace kinescope
