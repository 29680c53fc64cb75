// SPDX-License-Identifier: Apache-2.0
//
// Takes   two or more calibrations of one robot, from recordings of their own.
// Gives   what differs of the robot itself, with its standard uncertainty and a p-value: neither
// the
//         base frame nor the camera, the markers' places or the zeros of the frames take part.
// Method  the axes where all channels read the same, described by numbers without a frame
//         (kinematics/model/axis_geometry.h) and by the ratio of every channel; each calibration's
//         covariance carried over by their Jacobian, the recordings independent; Holm 1979 over all
//         that was compared.
// Not here: how well one calibration predicts the other's recording (calib/quality/carried_over.h).
#pragma once

#include <span>
#include <string>
#include <vector>

#include "calib/bundle/calibration.h"
#include "calib/quality/robot_parameters.h"
#include "kinematics/model/axis_geometry.h"

namespace kinescope {

/// The joints of one robot in another calibration of it.
struct RobotMatch {
  std::vector<int> joint_of;  ///< beside the first tree's joints; -1: fixed, or not there
  bool by_order = false;      ///< channels have other names, and stand for one another by order
  /// Beside the first tree's joints: the other's reading is this many times the first's (180/pi:
  /// its log is in degrees, the first's in rad).
  std::vector<double> reading_ratio;
  /// Likewise: its channel counts in a unit of its own, from a zero of its own (encoder ticks
  /// beside rad), so that the ratio says nothing of the robot.
  std::vector<bool> own_unit;
  std::vector<std::string> differences;  ///< of the structure, in words; empty: the same
};

/// Joints with the same channel are the same joint; where no channel is named alike, those at the
/// same place in the tree. Empty `joint_of` where the two are not one robot: neither the channels
/// nor the types of the joints agree.
[[nodiscard]] RobotMatch match_robots(const KinematicTree& first, const KinematicTree& other);

struct RobotQuantity {
  std::string name;   ///< "distance joint2 - joint3", in words
  std::string unit;   ///< "m", "rad"; "": relative
  std::string joint;  ///< the first that it is of
};

/// Which numbers describe a robot, and at which readings. Of the first calibration.
struct RobotLayout {
  std::vector<int> joints;   ///< those that move, of the first tree
  std::vector<int> parents;  ///< of each the one before it, among them; -1: the base
  Eigen::VectorXd readings;  ///< beside `joints`, as the first's log has them: scale * reading is
                             ///< the joint's value
  AxisLayout axes;
  double extent_m = 0.0;                  ///< largest distance between axes
  std::vector<RobotQuantity> quantities;  ///< of the axes, then the ratio of every joint
};

/// `runs` and `matches` (of runs[0] with each, its own the first) side by side.
[[nodiscard]] RobotLayout robot_layout(std::span<const Calibration> runs,
                                       std::span<const RobotMatch> matches);

struct RobotNumbers {
  Eigen::VectorXd values;      ///< beside RobotLayout::quantities; of a ratio its logarithm, in
                               ///< the unit of the first's log
  Eigen::MatrixXd covariance;  ///< likewise
  std::vector<NumberState> states;
  /// d value / d m of the height at which distances of parallel axes are meant (axis_geometry.h).
  Eigen::VectorXd by_height;
};

[[nodiscard]] RobotNumbers robot_numbers(const RobotLayout& layout, const Calibration& run,
                                         const RobotMatch& match);

/// One number of the robot in two calibrations.
struct QuantityDifference {
  RobotQuantity of;
  double first = 0.0;
  double second = 0.0;
  double difference = 0.0;   ///< second minus first; of angles the smallest, of ratios relative
  Sigma sigma;               ///< of the difference; none: not compared
  std::string not_compared;  ///< why, in words; empty: it was
  double p_value = 1.0;      ///< two-sided, of no difference
  double p_holm = 1.0;       ///< corrected for all that was compared
  bool changed = false;
};

/// The height at which distances are meant in the second against the first (of robots whose axes
/// are all nearly parallel) is, for each number, the one at which most of the others agree: by
/// truncated squares (Torr and Zisserman 2000), as what changed must not move it.
[[nodiscard]] std::vector<QuantityDifference> robot_differences(const RobotLayout& layout,
                                                                const RobotNumbers& first,
                                                                const RobotNumbers& second);

/// p_value of what was compared, by its sigma.
void fill_p_values(std::span<QuantityDifference> differences);

/// Corrects the p-values of all of them together (Holm, "A simple sequentially rejective multiple
/// test procedure", 1979): where nothing changed, anything is called changed with probability
/// `level` at most.
void judge_together(std::span<QuantityDifference* const> differences, double level);

}  // namespace kinescope
