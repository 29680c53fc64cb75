// SPDX-License-Identifier: Apache-2.0
//
// Takes   a DynamicModel (tree, inertias, gravity) and joint values, rates and accelerations.
// Gives   torques and their parts, energies, mass matrix, the regressor and the base parameters.
// Frames  a body's frame is its link's (URDF); torques along the joint axes, N m or N. Vectors have
//         one entry a moving joint, in the tree's order; matrices of samples one row a sample.
// Method  recursive Newton-Euler, composite bodies (Featherstone 2008); Atkeson et al. 1986.
// Not here: friction, estimation (identify); mimic joints (refused where URDF is read).
#pragma once

#include <string>
#include <vector>

#include "kinematics/model/dynamic_model.h"

namespace kinescope {

/// One moving body: the child link of a movable joint with all links that fixed joints tie to it.
struct RigidBody {
  std::string name;   ///< of the child link
  std::string joint;  ///< name of the joint that moves it
  JointType type = JointType::kRevolute;
  int parent = -1;  ///< body that carries the joint; -1 is the base
  Eigen::Matrix3d R_parent_joint = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_parent_joint = Eigen::Vector3d::Zero();  ///< m
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< unit, in the joint's and the body's frame
  InertialParameters inertia;                       ///< in the body's frame
  double motor_inertia = 0.0;                       ///< kg m^2 or kg, joint side
};

/// Where a link of the tree sits.
struct LinkPlacement {
  int body = -1;  ///< -1: fixed to the base, moves nothing
  Pose T_body_link;
};

/// The robot as its moving bodies; parents stand before children. Body k moves with entry k of q.
struct RigidModel {
  std::vector<RigidBody> bodies;
  std::vector<LinkPlacement> links;                             ///< one a link of the tree
  Eigen::Vector3d gravity_m_s2{0.0, 0.0, -kUsualGravity_m_s2};  ///< in the base frame

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(bodies.size()); }
};

/// Throws std::logic_error for an invalid model.
[[nodiscard]] RigidModel make_rigid_model(const DynamicModel& model);

/// The bodies' parameters, ten a body, stacked: what the regressor multiplies.
[[nodiscard]] Eigen::VectorXd body_parameters(const RigidModel& model);
/// The same model with other parameters of its bodies.
[[nodiscard]] RigidModel with_body_parameters(const RigidModel& model,
                                              const Eigen::VectorXd& parameters);
/// 10 bodies x 10 links: from the parameters of all links of the tree (each in its own frame,
/// stacked) to those of the bodies. Columns of links that are fixed to the base are zero.
[[nodiscard]] Eigen::MatrixXd bodies_from_links(const RigidModel& model);

}  // namespace kinescope
