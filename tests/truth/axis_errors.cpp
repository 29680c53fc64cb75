// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/axis_errors.h"

#include <algorithm>
#include <cmath>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope::truth {
namespace {

struct Line {
  Eigen::Vector3d direction, point;
  bool turns = false;
};

Eigen::Vector3d across(const Eigen::Vector3d& direction, const Eigen::Vector3d& v) {
  return v - v.dot(direction) * direction;
}

// The turn, and the shift, from the true line to the found one.
Eigen::Vector3d turn(const Line& a, const Eigen::Vector3d& found) {
  return a.direction.cross(a.direction.dot(found) < 0.0 ? -found : found);
}

Eigen::Vector3d shift(const Line& a, const Eigen::Vector3d& found) {
  return across(a.direction, found - a.point);
}

double extent_m(const std::vector<Line>& lines) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double count = 0.0;
  for (const Line& line : lines) {
    if (!line.turns) continue;
    middle += line.point;
    count += 1.0;
  }
  middle /= std::max(1.0, count);
  double square = 0.0;
  for (const Line& line : lines) {
    if (line.turns) square += (line.point - middle).squaredNorm();
  }
  return std::max(0.1, std::sqrt(square / std::max(1.0, count)));
}

std::vector<Line> lines_of(const KinematicTree& truth, const Calibration& found,
                           const Pose& T_found_truth) {
  Eigen::VectorXd mean(found.joint_values.cols());
  for (Eigen::Index j = 0; j < mean.size(); ++j) mean[j] = found.joint_values.col(j).mean();
  const auto links = forward_kinematics(truth, mean);
  std::vector<Line> lines;
  for (std::size_t j = 0; j < truth.joints.size(); ++j) {
    const Joint& joint = truth.joints[j];
    const Pose T = T_found_truth * links[joint.parent.index()] * joint.T_parent_joint;
    const Eigen::Vector3d direction = T.rotation * joint.axis;
    // Where the found point stands: a turn of the whole moves the points of an axis differently.
    const double along_m = direction.dot(found.joints[j].point_base - T.translation);
    lines.push_back(
        {direction, T.translation + along_m * direction, joint.type == JointType::kRevolute});
  }
  return lines;
}

// The motion of the true lines that brings them nearest: turn across the axis, shift + turn x point
// across it.
Pose motion_towards(const Calibration& found, const std::vector<Line>& lines) {
  const double angle_m = extent_m(lines);
  Matrix6d normal = Matrix6d::Zero();
  Vector6d right = Vector6d::Zero();
  for (std::size_t j = 0; j < lines.size(); ++j) {
    const Line& line = lines[j];
    const Eigen::Matrix3d P =
        Eigen::Matrix3d::Identity() - line.direction * line.direction.transpose();
    Eigen::Matrix<double, 3, 6> by = Eigen::Matrix<double, 3, 6>::Zero();
    by.leftCols<3>() = angle_m * P;
    normal += by.transpose() * by;
    right += by.transpose() * angle_m * turn(line, found.joints[j].axis_base);
    if (!line.turns) continue;
    for (int i = 0; i < 3; ++i) by.col(i) = P * Eigen::Vector3d::Unit(i).cross(line.point);
    by.rightCols<3>() = P;
    normal += by.transpose() * by;
    right += by.transpose() * shift(line, found.joints[j].point_base);
  }
  const Vector6d motion = normal.completeOrthogonalDecomposition().solve(right);
  return {exp_rotation(motion.head<3>()), motion.tail<3>()};
}

std::vector<AxisDifference> differences(const Calibration& found, const std::vector<Line>& lines) {
  std::vector<AxisDifference> out;
  for (std::size_t j = 0; j < lines.size(); ++j) {
    AxisDifference& axis = out.emplace_back();
    axis.direction_rad = turn(lines[j], found.joints[j].axis_base).norm();
    if (lines[j].turns) axis.position_m = shift(lines[j], found.joints[j].point_base).norm();
  }
  return out;
}

}  // namespace

AxisDifferences axis_differences(const KinematicTree& truth, const Calibration& found) {
  constexpr int kSteps = 5;  // a marker that is seen in a few frames is off by degrees
  Pose T_found_truth =
      found.tree.markers.front().T_link_marker * truth.markers.front().T_link_marker.inverse();
  AxisDifferences out;
  out.in_base = differences(found, lines_of(truth, found, T_found_truth));
  for (int step = 0; step < kSteps; ++step)
    T_found_truth = motion_towards(found, lines_of(truth, found, T_found_truth)) * T_found_truth;
  out.among = differences(found, lines_of(truth, found, T_found_truth));
  return out;
}

}  // namespace kinescope::truth
