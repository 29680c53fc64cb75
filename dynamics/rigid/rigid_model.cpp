// SPDX-License-Identifier: Apache-2.0
#include "dynamics/rigid/rigid_model.h"

#include "kinematics/core/error.h"

namespace kinescope {

RigidModel make_rigid_model(const DynamicModel& model) {
  check_model(model);
  const KinematicTree& tree = model.tree;
  RigidModel out{.bodies = {},
                 .links = std::vector<LinkPlacement>(tree.links.size()),
                 .gravity_m_s2 = model.gravity_m_s2};
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    const LinkPlacement& parent = out.links[joint.parent.index()];
    const Pose T_body_joint = parent.T_body_link * joint.T_parent_joint;
    LinkPlacement& child = out.links[joint.child.index()];
    if (joint.type == JointType::kFixed) {
      child = {.body = parent.body, .T_body_link = T_body_joint};
    } else {
      child = {.body = static_cast<int>(out.bodies.size()), .T_body_link = {}};
      out.bodies.push_back({.name = tree.links[joint.child.index()].name,
                            .joint = joint.name,
                            .type = joint.type,
                            .parent = parent.body,
                            .R_parent_joint = T_body_joint.matrix3(),
                            .p_parent_joint = T_body_joint.translation,
                            .axis = joint.axis,
                            .inertia = {},
                            .motor_inertia = model.joints[j].motor_inertia});
    }
    if (child.body < 0) continue;
    out.bodies[static_cast<std::size_t>(child.body)].inertia +=
        in_frame(child.T_body_link, model.links[joint.child.index()]);
  }
  return out;
}

Eigen::VectorXd body_parameters(const RigidModel& model) {
  Eigen::VectorXd out(10 * model.size());
  for (Eigen::Index b = 0; b < model.size(); ++b) {
    out.segment<10>(10 * b) = model.bodies[static_cast<std::size_t>(b)].inertia.vector();
  }
  return out;
}

RigidModel with_body_parameters(const RigidModel& model, const Eigen::VectorXd& parameters) {
  KINESCOPE_CHECK(parameters.size() == 10 * model.size(), "ten parameters a body");
  RigidModel out = model;
  for (Eigen::Index b = 0; b < model.size(); ++b) {
    out.bodies[static_cast<std::size_t>(b)].inertia =
        InertialParameters::from_vector(parameters.segment<10>(10 * b));
  }
  return out;
}

Eigen::MatrixXd bodies_from_links(const RigidModel& model) {
  const auto links = static_cast<Eigen::Index>(model.links.size());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(10 * model.size(), 10 * links);
  for (Eigen::Index l = 0; l < links; ++l) {
    const LinkPlacement& link = model.links[static_cast<std::size_t>(l)];
    if (link.body < 0) continue;
    out.block<10, 10>(Eigen::Index{10} * link.body, 10 * l) =
        inertial_frame_change(link.T_body_link);
  }
  return out;
}

}  // namespace kinescope
