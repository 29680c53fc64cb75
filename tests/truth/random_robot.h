// SPDX-License-Identifier: Apache-2.0
//
// Takes   option structs and a seeded generator.
// Gives   random robots (chains and trees) with markers, and recordings of them (marker poses over
// time and a
//         joint log) with exact truth. No camera model here: markers are poses in the camera's
//         frame.
// Frames  the robot's base is link 0 of the tree; T_camera_base places it.
#pragma once

#include <string>
#include <vector>

#include "kinematics/core/rng.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/model/kinematic_tree.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

struct RandomRobotOptions {
  int joints = 6;
  bool tree = false;  ///< every link may be the parent of the next; else a serial chain
  double prismatic_share = 0.3;
  bool parallel_axes = false;     ///< all axes along one direction, as in a SCARA
  double link_offset_m = 0.25;    ///< from joint to joint
  double marker_offset_m = 0.05;  ///< from the link's frame to its marker
  int markers_per_link = 1;
  bool base_marker = true;
  std::vector<int> unmarked_links = {};  ///< links (1 = child of joint 0) that carry no marker
  bool shuffle_ids = true;               ///< marker ids do not follow the chain
};

/// A robot and where the camera sees it. Joint k's child is link k + 1.
struct RandomRobot {
  KinematicTree tree;
  Pose T_camera_base;
};

[[nodiscard]] RandomRobot random_robot(const RandomRobotOptions& options, Rng& rng);

struct RecordingOptions {
  int frames = 600;
  double rate_hz = 30.0;
  double log_rate_hz = 100.0;
  double amplitude_rad = 1.0;        ///< bound of the joint values
  double prismatic_m_per_rad = 0.2;  ///< prismatic joints move this much where others turn by 1 rad
  double lowest_hz = 0.05;           ///< of the three sines of every joint
  double highest_hz = 0.25;
  double sigma_m = 1e-3;
  double sigma_rad = 0.1 * 3.14159265358979323846 / 180.0;
  double corner_px = 0.0;  ///< above 0: noise of a square target's pose from corners this exact
  double declared_noise = 1.0;  ///< declared sigma over the true one
  double flip_share = 0.0;      ///< frames that show the wrong planar branch first
  bool alternatives = false;    ///< both branches are given
  double missing_share = 0.0;   ///< sightings that are missing
  double channel_scale = 1.0;   ///< reading = value * scale
  bool random_signs = false;    ///< some channels count the other way
  bool ticks = false;           ///< every channel in its own ticks with its own zero
  double coupling = 0.0;        ///< joint k also moves with the parent's motion, as a share
  double lag_s = 0.0;           ///< joint-log time = frame time + lag
  double log_margin_s = 1.5;    ///< that the log starts before and ends after the frames
  double backlash_rad = 0.0;    ///< width of the gap between encoder and link
  int idle_channels = 0;        ///< channels that drive nothing
  bool shuffle_channels = true;
  std::vector<int> still_joints = {};  ///< joints that do not move
  std::vector<std::pair<int, int>> together =
      {};  ///< (a, b): joint b repeats the motion of joint a
};

/// A recording with its truth.
struct RobotRecording {
  PoseTracks tracks;
  JointLog log;
  std::vector<int> channel_of_joint;   ///< index into log.channels
  std::vector<double> scale_of_joint;  ///< rad or m per unit of the channel
  Eigen::MatrixXd joint_values;        ///< frames x joints, true values
};

[[nodiscard]] RobotRecording record(const RandomRobot& robot, const RecordingOptions& options,
                                    Rng& rng);

/// The second pose of a planar target: its normal mirrored about the line of sight to its centre.
[[nodiscard]] Pose flipped_pose(const Pose& T_camera_marker);

}  // namespace kinescope
