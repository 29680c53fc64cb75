// SPDX-License-Identifier: Apache-2.0
//
// Takes   nothing; this is the robot as a value.
// Gives   KinematicTree: links, joints, markers; forward kinematics and its Jacobian.
// Frames  a link's frame is its joint's frame after the motion (as in URDF):
//         T_parent_child(q) = T_parent_joint * exp(axis * q), axis in the joint frame.
//         Link 0 is the root ("base"). Values are SI: rad or m.
// Not here: reading and writing (kinematics/urdf), estimation (calib/bundle).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/core/ids.h"
#include "kinematics/core/pose.h"

namespace kinescope {

enum class JointType { kFixed, kRevolute, kPrismatic };

[[nodiscard]] std::string_view to_string(JointType type);

/// Scales of channels in units that people log.
inline constexpr double kRadPerDegree = 0.017453292519943295;
inline constexpr double kMetrePerMillimetre = 1e-3;

/// Lowest and highest joint value, rad or m.
struct JointLimits {
  double lower = 0.0;
  double upper = 0.0;
  bool operator==(const JointLimits&) const = default;
};

/// A further channel that moves a joint by design, as in a counter-commanded wrist.
struct ChannelShare {
  std::string channel;
  double ratio = 0.0;  ///< against the joint's own channel
  bool operator==(const ChannelShare&) const = default;
};

struct Joint {
  std::string name;
  JointType type = JointType::kFixed;
  LinkId parent;
  LinkId child;
  Pose T_parent_joint;                              ///< where the joint sits on its parent
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< unit, in the joint frame
  std::string channel;                              ///< log channel that drives it; may be empty
  std::vector<std::string> copies;  ///< channels that tell the same (its command, say), unused
  double scale = 1.0;               ///< rad (or m) per unit of the channel
  double offset = 0.0;              ///< of the value, see below
  /// value = scale * (reading + ratio * its reading + ..) + offset
  std::vector<ChannelShare> couplings;
  std::optional<JointLimits> limits;
  /// What the drive may do, as the robot's own file says; no recording tells.
  std::optional<double> effort;    ///< N m (revolute) or N
  std::optional<double> velocity;  ///< rad/s or m/s
};

[[nodiscard]] inline bool is_movable(const Joint& joint) { return joint.type != JointType::kFixed; }

struct Link {
  std::string name;
};

/// A marker (or tracked body) fixed to a link.
struct Marker {
  TagId id;
  LinkId link;
  Pose T_link_marker;
  double size_m = 0.0;  ///< edge of the black square; 0 for a body that is no tag
};

struct KinematicTree {
  std::string name = "robot";
  std::vector<Link> links;    ///< links[0] is the root
  std::vector<Joint> joints;  ///< parents stand before children
  std::vector<Marker> markers;

  [[nodiscard]] std::optional<LinkId> link(std::string_view link_name) const;
  [[nodiscard]] std::optional<JointId> joint(std::string_view joint_name) const;
  [[nodiscard]] const Marker* marker(TagId id) const;
  /// The joint whose child is the link; none for the root.
  [[nodiscard]] std::optional<JointId> parent_joint(LinkId link) const;
  /// Joints from the root to the link, in that order.
  [[nodiscard]] std::vector<JointId> path_to(LinkId link) const;
};

/// Throws std::logic_error unless the tree is one: every link but the first has one parent joint,
/// parents stand before children, axes are unit vectors, names are unique.
void check_tree(const KinematicTree& tree);

/// The motion of a joint: exp(axis * value); identity for a fixed one.
[[nodiscard]] Pose joint_motion(JointType type, const Eigen::Vector3d& axis, double value);

/// T_base_link of every link. `values` has one entry a joint (rad, m; ignored for fixed joints).
[[nodiscard]] std::vector<Pose> forward_kinematics(const KinematicTree& tree,
                                                   const Eigen::VectorXd& values);

/// Body Jacobian of a link, 6 x joints (rotation, then translation, in the link's frame, per rad or
/// m): T(q + d) = T(q) exp(J d) to first order. Murray, Li, Sastry 1994, eq. 3.56.
[[nodiscard]] Eigen::Matrix<double, 6, Eigen::Dynamic> body_jacobian(const KinematicTree& tree,
                                                                     const Eigen::VectorXd& values,
                                                                     LinkId link);

}  // namespace kinescope
