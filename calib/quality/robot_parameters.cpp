// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/robot_parameters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

namespace kinescope {
namespace {

// Of central differences, in the parameter's unit (rad, m, rad per unit: relative to the scale).
constexpr double kParameterStep = 1e-6;
// Of derivatives by the parameters: rounding.
constexpr double kNoInfluence = 1e-7;

// Which of (rx ry rz tx ty tz), by the words that the bundle has for them; -1: none.
int component_of(std::string_view words) {
  static constexpr std::array<std::string_view, 6> kWords{"turn x",  "turn y",  "turn z",
                                                          "shift x", "shift y", "shift z"};
  const auto found = std::ranges::find(kWords, words);
  return found == kWords.end() ? -1 : static_cast<int>(found - kWords.begin());
}

// Moves what a parameter of the joint moves. False: nothing of the robot.
bool move_joint(Joint& joint, const Parameter& parameter, double parameters_at, double step) {
  if (parameter.block != joint.name || !parameter.name.starts_with(joint.name + " ")) return false;
  const std::string_view words = std::string_view(parameter.name).substr(joint.name.size() + 1);
  if (words == "scale") {
    joint.scale += step;
    return true;
  }
  Pose moved = joint_motion(joint.type, joint.axis, step);  // "offset"
  if (const int component = component_of(words); component >= 0) {
    const Pose there = joint_motion(joint.type, joint.axis, parameters_at);
    moved = there * exp_pose(step * Vector6d::Unit(component)) * there.inverse();
  } else if (words != "offset") {
    return false;
  }
  joint.T_parent_joint = joint.T_parent_joint * moved;
  return true;
}

}  // namespace

double parameter_step(const KinematicTree& tree, const Parameter& parameter) {
  for (const Joint& joint : tree.joints)
    if (parameter.block == joint.name && parameter.name == joint.name + " scale")
      return kParameterStep * std::abs(joint.scale);
  return kParameterStep;
}

bool move_robot(KinematicTree& tree, const Calibration& run, const Parameter& parameter,
                double step) {
  for (std::size_t j = 0; j < tree.joints.size(); ++j)
    if (move_joint(tree.joints[j], parameter, run.joints[j].parameters_at, step)) return true;
  return false;
}

bool has_influence(double derivative) { return std::abs(derivative) >= kNoInfluence; }

NumberState number_state(const Eigen::RowVectorXd& derivatives, const Calibration& run) {
  bool any = false;
  for (std::size_t p = 0; p < run.parameters.size(); ++p) {
    const double unit = parameter_step(run.tree, run.parameters[p]) / kParameterStep;
    if (!has_influence(derivatives[static_cast<Eigen::Index>(p)] * unit)) continue;
    if (!run.parameters[p].sigma) return NumberState::kUndetermined;
    any = true;
  }
  return any ? NumberState::kEstimated : NumberState::kHeld;
}

}  // namespace kinescope
