// SPDX-License-Identifier: Apache-2.0
#include "kinematics/urdf/camera_links.h"

#include <string>
#include <utility>

#include <fmt/format.h>

namespace kinescope {
namespace {

Pose optical_in_body() {
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {Eigen::Quaterniond(R), Eigen::Vector3d::Zero()};
}

template <typename IsTaken>
std::string unused(const std::string& wanted, IsTaken is_taken) {
  std::string out = wanted;
  for (int n = 2; is_taken(out); ++n) out = fmt::format("{}_{}", wanted, n);
  return out;
}

LinkId hang(KinematicTree& tree, LinkId parent, const std::string& link, const std::string& joint,
            const Pose& T) {
  Joint out;
  out.name = unused(joint, [&](const std::string& name) { return tree.joint(name).has_value(); });
  out.type = JointType::kFixed;
  out.parent = parent;
  out.child = LinkId{static_cast<int>(tree.links.size())};
  out.T_parent_joint = T;
  tree.links.push_back(
      {unused(link, [&](const std::string& name) { return tree.link(name).has_value(); })});
  tree.joints.push_back(std::move(out));
  return tree.joints.back().child;
}

}  // namespace

KinematicTree with_camera_links(KinematicTree tree, LinkId carrier, const Pose& T_carrier_optical) {
  const Pose T_body_optical = optical_in_body();
  const LinkId body = hang(tree, carrier, "camera_link", "camera_joint",
                           T_carrier_optical * T_body_optical.inverse());
  hang(tree, body, "camera_optical_frame", "camera_optical_joint", T_body_optical);
  return tree;
}

}  // namespace kinescope
