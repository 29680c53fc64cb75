// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/slight_turn.h"

#include <numbers>

#include "kinematics/structure/resting_joint.h"

namespace kinescope {
namespace {

// The slide of 0.2 m that a lens bent (`undeclared`, 9538) turned by 0.5 deg about an axis at 20 m.
// A turn of 5 deg leaves its tangent by 2 % of the way.
constexpr double kSlight = 5.0 * std::numbers::pi / 180.0;

}  // namespace

std::optional<Structure> with_slide_for_slight_turn(const Structure& structure, std::size_t joint,
                                                    const JointLog& log) {
  const StructureJoint& turn = structure.joints[joint];
  if (turn.type != JointType::kRevolute || !turn.channel || !turn.couplings.empty() ||
      turn.travel > kSlight)
    return std::nullopt;
  const double angle = usual_value(structure, joint, log);
  const Pose T_joint_marker =
      joint_motion(turn.type, Eigen::Vector3d::UnitZ(), angle) * turn.T_joint_child;
  // Metres of the marker per radian.
  const Eigen::Vector3d tangent = Eigen::Vector3d::UnitZ().cross(T_joint_marker.translation);
  if (!(tangent.norm() > 0.0)) return std::nullopt;
  Structure out = structure;
  out.rivals.clear();
  StructureJoint& slide = out.joints[joint];
  slide.type = JointType::kPrismatic;
  slide.T_parent_joint = turn.T_parent_joint *
                         Pose{Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), tangent),
                              T_joint_marker.translation};
  slide.T_joint_child = slide.T_parent_joint.inverse() * turn.T_parent_joint * T_joint_marker;
  slide.channel->scale *= tangent.norm();
  slide.channel->scale_sigma *= tangent.norm();
  slide.offset = (turn.offset - angle) * tangent.norm();
  slide.travel *= tangent.norm();
  return out;
}

}  // namespace kinescope
