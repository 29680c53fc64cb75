// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/flange_log.h"

#include <functional>

#include <gtest/gtest.h>

#include "kinematics/core/csv.h"
#include "tests/kinematics/structure/scenes.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

constexpr double kClocksApartS = 0.3;

Eigen::VectorXd quaternion_w_last(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  return Eigen::Vector4d(q.x(), q.y(), q.z(), q.w());
}

Eigen::VectorXd quaternion_w_first(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  return Eigen::Vector4d(q.w(), q.x(), q.y(), q.z());
}

Eigen::VectorXd rotation_vector(const Pose& pose) { return log_rotation(pose.rotation); }

// About z, then the new y, then the new x.
Eigen::Vector3d yaw_pitch_roll(const Pose& pose) {
  const Eigen::Matrix3d R = pose.matrix3();
  return {std::atan2(R(1, 0), R(0, 0)), std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2))),
          std::atan2(R(2, 1), R(2, 2))};
}

Eigen::VectorXd roll_pitch_yaw(const Pose& pose) { return yaw_pitch_roll(pose).reverse(); }

Eigen::VectorXd degrees_about_z_y_x(const Pose& pose) { return yaw_pitch_roll(pose) / kDegree; }

// Of a robot of six joints that turn by half a radian the base and the hand alone carry markers.
Scene hand_and_base(const std::string& name, std::vector<int> unmarked = {1, 2, 3, 4, 5}) {
  RecordingOptions options = noisy();
  options.amplitude_rad = 0.3;
  return make_scene(
      name, {.joints = 6, .prismatic_share = 0.0, .unmarked_links = std::move(unmarked)}, options);
}

// What a controller would log of the hand's pose.
JointLog pose_log(const Scene& scene, const std::function<Eigen::VectorXd(const Pose&)>& rotation,
                  bool inverted = false) {
  JointLog log;
  const Eigen::MatrixXd& values = scene.recording.joint_values;
  for (Eigen::Index f = 0; f < values.rows(); ++f) {
    const auto frame = static_cast<std::size_t>(f);
    log.times_s.push_back(scene.recording.tracks.times_s[frame] + kClocksApartS);
    const auto links = forward_kinematics(scene.robot.tree, values.row(f).transpose());
    const Pose pose = inverted ? links.back().inverse() : links.back();
    const Eigen::VectorXd turn = rotation(pose);
    if (f == 0) log.values.resize(values.rows(), 3 + turn.size());
    log.values.row(f) << pose.translation.transpose(), turn.transpose();
  }
  for (Eigen::Index c = 0; c < log.values.cols(); ++c)
    log.channels.push_back("c" + std::to_string(c));
  return log;
}

TEST(FlangeLog, PosesInEveryConventionAreSeenToBeNoJointValues) {
  const Scene scene = hand_and_base("Flange");
  const std::vector<std::pair<std::string, std::function<Eigen::VectorXd(const Pose&)>>> all{
      {"quaternion, w last", quaternion_w_last},
      {"quaternion, w first", quaternion_w_first},
      {"rotation vector", rotation_vector},
      {"roll, pitch, yaw about fixed axes", roll_pitch_yaw},
      {"angles about z, then y, then x", degrees_about_z_y_x}};
  for (const auto& [words, rotation] : all) {
    for (const bool inverted : {false, true}) {
      const auto found =
          flange_columns(scene.recording.tracks, pose_log(scene, rotation, inverted), 1.0);
      ASSERT_TRUE(found) << words;
      EXPECT_EQ(found->convention, words);
      EXPECT_EQ(found->position, (std::vector{0, 1, 2}));
      EXPECT_EQ(found->rotation.front(), 3);
      EXPECT_EQ(found->inverted, inverted) << words;
      EXPECT_LT(found->misfit_rad, 2.0 * kDegree) << "what noise of 0.5 deg and a clock that is "
                                                     "known to 25 ms leave";
    }
  }
}

// A camera on the hand of an AUBO i5, one marker at rest; 32 postures.
TEST(FlangeLog, AMeasuredHandAndItsCamera) {
  const auto path = shared_data("vision/aubo_i5_handeye/poses.csv");
  if (!path) GTEST_SKIP() << "vision/aubo_i5_handeye is not on this machine";
  const CsvTable table = read_csv(*path);
  const auto value = [&](std::size_t row, const char* name) {
    return table.number(row, table.require_column(name));
  };
  JointLog log;
  log.channels = {"x", "y", "z", "rx", "ry", "rz"};
  log.values.resize(static_cast<Eigen::Index>(table.rows.size()), 6);
  PoseTracks tracks;
  tracks.tracks = {{TagId{5}, {}}};
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    tracks.times_s.push_back(static_cast<double>(row));
    log.values.row(static_cast<Eigen::Index>(row)) << value(row, "base_T_hand_x_m"),
        value(row, "base_T_hand_y_m"), value(row, "base_T_hand_z_m"),
        value(row, "base_T_hand_rx_deg"), value(row, "base_T_hand_ry_deg"),
        value(row, "base_T_hand_rz_deg");
    PoseSample sample;
    sample.frame = static_cast<int>(row);
    const Eigen::Vector3d angles = kDegree * Eigen::Vector3d(value(row, "cam_T_marker_rx_deg"),
                                                             value(row, "cam_T_marker_ry_deg"),
                                                             value(row, "cam_T_marker_rz_deg"));
    sample.T_camera_marker = {exp_rotation({0.0, 0.0, angles.z()}) *
                                  exp_rotation({0.0, angles.y(), 0.0}) *
                                  exp_rotation({angles.x(), 0.0, 0.0}),
                              {value(row, "cam_T_marker_x_m"), value(row, "cam_T_marker_y_m"),
                               value(row, "cam_T_marker_z_m")}};
    tracks.tracks.front().samples.push_back(sample);
  }
  log.times_s = tracks.times_s;
  const auto found = flange_columns(tracks, log, 0.0);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->convention, "roll, pitch, yaw about fixed axes");
  EXPECT_TRUE(found->inverted);
  EXPECT_LT(found->misfit_rad, 3.0 * kDegree);
}

TEST(FlangeLog, JointValuesAreNone) {
  for (int seed = 0; seed < 20; ++seed) {
    const Scene scene = hand_and_base("Joints " + std::to_string(seed));
    EXPECT_FALSE(flange_columns(scene.recording.tracks, scene.recording.log, 1.0)) << seed;
  }
}

TEST(FlangeLog, AMarkerThatMovesOtherwiseIsARobotsLink) {
  const Scene scene = hand_and_base("Flange", {1, 2, 4, 5});
  EXPECT_FALSE(flange_columns(scene.recording.tracks, pose_log(scene, rotation_vector), 1.0));
}

TEST(FlangeLog, JointValuesBesideThePoseAreLookedAt) {
  const Scene scene = hand_and_base("Flange");
  JointLog log = pose_log(scene, quaternion_w_last);
  const Eigen::Index pose = log.values.cols();
  log.values.conservativeResize(Eigen::NoChange, pose + 2);
  log.values.rightCols(2) = scene.recording.joint_values.leftCols(2);
  log.channels.insert(log.channels.end(), {"q1", "q2"});
  EXPECT_FALSE(flange_columns(scene.recording.tracks, log, 1.0));
}

}  // namespace
}  // namespace kinescope
