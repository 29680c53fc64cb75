// SPDX-License-Identifier: Apache-2.0
//
// The truth of a rendered recording (truth.json), and how far a learned robot is from it after the
// free choices (world frame) are aligned. Read from the files only, independent of the program.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope::acceptance {

struct TruthRobot {
  KinematicTree tree;              ///< joints named after the channels that drive them
  std::vector<JointLimits> range;  ///< beside tree.joints: what the recording shows
  double latency_s = 0.0;          ///< frame stamped t shows the robot at t - latency
  std::string effect;              ///< kind of the undeclared effect
};

[[nodiscard]] TruthRobot read_truth(const std::filesystem::path& truth_json);

struct AxisError {
  std::string joint;
  JointType type = JointType::kFixed;
  double direction_rad = 0.0;
  double position_m = 0.0;  ///< revolute only: distance of the axes near the child's markers
};

struct TruthComparison {
  std::vector<AxisError> axes;
  double marker_rms_m = 0.0;  ///< of tag centres at random postures within the recorded ranges
  double scale = 0.0;         ///< learned over true lengths, minus one
  double median_direction_rad = 0.0, worst_direction_rad = 0.0;
  double median_position_m = 0.0, worst_position_m = 0.0;
};

/// Throws std::runtime_error when a joint or tag of the truth is missing in the learned robot.
[[nodiscard]] TruthComparison compare_with_truth(const TruthRobot& truth,
                                                 const KinematicTree& learned);

/// Empty when structure, types and channels agree; else what differs.
[[nodiscard]] std::string structure_difference(const TruthRobot& truth,
                                               const KinematicTree& learned);

}  // namespace kinescope::acceptance
