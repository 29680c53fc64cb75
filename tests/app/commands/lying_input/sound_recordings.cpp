// SPDX-License-Identifier: Apache-2.0
#include "tests/app/commands/lying_input/sound_recordings.h"

#include <cmath>
#include <filesystem>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/core/file.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "kinematics/urdf/urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/truth/torque_world.h"

namespace kinescope::lying {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCamera =
    "image_width: 1280\nimage_height: 720\ncamera_matrix: {rows: 3, cols: 3, data: [900, 0, 640, "
    "0, "
    "900, 360, 0, 0, 1]}\ndistortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, "
    "data: [0.1, 0, 0, 0, 0]}\n";

}  // namespace

RandomRobot robot_of_poses() {
  Rng rng = Rng::from_name("lying input");
  return random_robot({.joints = 3, .prismatic_share = 0.0}, rng);
}

RobotRecording poses_of(const RecordingOptions& options) {
  Rng rng = Rng::from_name("lying input, motion");
  RecordingOptions few = options;
  few.frames = 200;
  few.lowest_hz = 0.2;
  few.highest_hz = 0.6;
  few.shuffle_channels = false;
  return record(robot_of_poses(), few, rng);
}

Files poses_files(const RecordingOptions& options) {
  const RobotRecording recording = poses_of(options);
  return {{"poses.csv", tracks_csv(recording.tracks)}, {"joints.csv", joints_csv(recording.log)}};
}

const Files& poses() {
  static const Files files = poses_files();
  return files;
}

const Files& corners() {
  static const Files files = [] {
    std::string text = "t,tag,corner,u,v\n";
    for (int frame = 0; frame < 40; ++frame) {
      const double angle = 0.1 * frame;
      for (const int tag : {3, 7}) {
        const double u = tag == 3 ? 200.0 : 900.0 + 200.0 * std::cos(angle);
        const double v = tag == 3 ? 300.0 : 350.0 + 200.0 * std::sin(angle);
        for (int corner = 0; corner < 4; ++corner) {
          const double x = corner == 1 || corner == 2 ? 20.0 : -20.0;
          const double y = corner < 2 ? 20.0 : -20.0;
          text +=
              fmt::format("{:.6f},{},{},{:.3f},{:.3f}\n", frame / 30.0, tag, corner, u + x, v + y);
        }
      }
    }
    std::string log = "t,a\n";
    for (int row = 0; row < 140; ++row)
      log += fmt::format("{:.2f},{:.4f}\n", 0.01 * row, 0.03 * row);
    return Files{{"corners.csv", text},
                 {"joints.csv", log},
                 {"camera.yaml", kCamera},
                 {"tags.yaml", "family: tag36h11\ndefault_size: 0.05\n"}};
  }();
  return files;
}

const Files& nominal() {
  static const Files files = [] {
    KinematicTree tree = robot_of_poses().tree;
    const RobotRecording recording = poses_of({});
    tree.markers.clear();
    for (std::size_t j = 0; j < tree.joints.size(); ++j) {
      tree.joints[j].name =
          recording.log.channels[static_cast<std::size_t>(recording.channel_of_joint[j])];
      tree.joints[j].limits = JointLimits{-2.0, 2.0};
    }
    Files out = poses();
    out["nominal.urdf"] = write_urdf(tree);
    return out;
  }();
  return files;
}

const Files& torques() {
  static const Files files = [] {
    Rng rng = Rng::from_name("lying torques");
    const RandomRobot robot = random_robot({.joints = 3, .prismatic_share = 0.0}, rng);
    const DynamicModel model = random_masses(robot.tree, {.every_direction = false}, rng);
    const TorqueSamples samples = torque_log_of(model, {.samples = 1500, .trajectories = 1}, rng);
    Files out{{"log.csv", torque_log_csv(samples)}, {"robot.urdf", write_urdf(model)}};
    const fs::path folder = truth::temporary_path("lying_input_model");
    fs::create_directories(folder);
    for (const auto& [name, text] : out) write_file_atomically(folder / name, text);
    const Outcome learned =
        run({"dynamics", (folder / "log.csv").string(), "--robot", (folder / "robot.urdf").string(),
             "--model", "parametric", "--no-trace", "--no-robust", "--save-model",
             (folder / "torque.json").string(), "--output", (folder / "out").string(), "--quiet"});
    EXPECT_EQ(learned.code, 0) << learned.err;
    out["torque.json"] = read_text_file(folder / "torque.json");
    fs::remove_all(folder);
    return out;
  }();
  return files;
}

}  // namespace kinescope::lying
