// SPDX-License-Identifier: Apache-2.0
//
// A robot with its masses: the tree and what its links weigh, what its joints rub, where down is.
#pragma once

#include <vector>

#include "kinematics/model/inertial_parameters.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// Standard gravity, CGPM 1901.
/// What simulators and most drivers assume; on Earth it lies between 9.78 and 9.83.
inline constexpr double kUsualGravity_m_s2 = 9.81;

/// What a joint adds to the rigid bodies, on the joint's side of the gear: motor_inertia * ddq +
/// viscous * dq + coulomb * sign(dq). N m for a revolute joint, N for a prismatic one.
struct JointDynamics {
  double viscous = 0.0;        ///< N m s/rad or N s/m
  double coulomb = 0.0;        ///< N m or N
  double motor_inertia = 0.0;  ///< kg m^2 or kg, times the gear ratio squared
  bool operator==(const JointDynamics&) const = default;
};

struct DynamicModel {
  KinematicTree tree;
  std::vector<InertialParameters> links;  ///< one a link of the tree, in the link's frame
  std::vector<JointDynamics> joints;      ///< one a joint of the tree, zero for fixed ones
  /// Acceleration of free fall in the root link's frame, m/s^2.
  Eigen::Vector3d gravity_m_s2{0.0, 0.0, -kUsualGravity_m_s2};
};

/// A model of the tree with massless links and ideal joints.
[[nodiscard]] DynamicModel without_masses(KinematicTree tree);

/// Throws std::logic_error unless the tree is one, sizes fit and every number is finite.
void check_model(const DynamicModel& model);

/// The joints that move, in the tree's order: the order of the columns of a joint log's arrays and
/// of the entries of every q, dq, ddq and torque of dynamics/.
[[nodiscard]] std::vector<JointId> moving_joints(const KinematicTree& tree);

}  // namespace kinescope
