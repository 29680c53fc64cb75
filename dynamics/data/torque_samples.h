// SPDX-License-Identifier: Apache-2.0
//
// The measured motion of a robot and the torques that go with it, ready for a dynamics model.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace kinescope {

/// Of torques, rows x joints: true where the reading was cut off, frozen or in a dead zone. What
/// stands there is a straight line between the readings before and behind.
using MissingTorque = Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic>;

/// Rows are samples, in time order within a trajectory; columns are joints, in the order of the
/// tree's movable joints. Revolute joints in rad, prismatic joints in m.
struct TorqueSamples {
  Eigen::VectorXd t_s;         ///< s, on the log's clock; increases within a trajectory
  Eigen::MatrixXd q;           ///< rad or m
  Eigen::MatrixXd dq;          ///< rad/s or m/s
  Eigen::MatrixXd ddq;         ///< rad/s^2 or m/s^2
  Eigen::MatrixXd torque;      ///< what the actuator applies along the joint: N m, N or torque_unit
  Eigen::VectorXi trajectory;  ///< 0, 1, ..: samples of one uninterrupted motion share a number
  std::vector<std::string> joint_names;       ///< one a column; empty when made by hand
  std::vector<std::string> trajectory_names;  ///< what each trajectory number is called in the log
  std::string torque_unit = "Nm";             ///< "Nm" (N for prismatic joints) or "A"
  /// Of each joint: what its logged torque is a multiple of; 0 where it is of none. Empty: not
  /// known.
  Eigen::VectorXd torque_step = {};
  /// samples x joints: no measurement stands behind this torque (MissingTorque). Empty: behind all.
  MissingTorque torque_missing = {};

  [[nodiscard]] Eigen::Index size() const { return t_s.size(); }
  [[nodiscard]] Eigen::Index joints() const { return q.cols(); }
  [[nodiscard]] bool is_missing(Eigen::Index row, Eigen::Index joint) const {
    return torque_missing.size() > 0 && torque_missing(row, joint);
  }
  /// All joints' torques were.
  [[nodiscard]] bool is_measured(Eigen::Index row) const {
    return torque_missing.size() == 0 || !torque_missing.row(row).any();
  }
  /// Its name, or its number where it has none.
  [[nodiscard]] std::string trajectory_name(int number) const {
    const auto at = static_cast<std::size_t>(number);
    return at < trajectory_names.size() ? trajectory_names[at] : std::to_string(number);
  }
};

}  // namespace kinescope
