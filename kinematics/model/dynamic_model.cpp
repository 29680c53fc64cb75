// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/dynamic_model.h"

#include <cmath>

#include "kinematics/core/error.h"

namespace kinescope {

DynamicModel without_masses(KinematicTree tree) {
  DynamicModel model{.tree = std::move(tree), .links = {}, .joints = {}};
  model.links.resize(model.tree.links.size());
  model.joints.resize(model.tree.joints.size());
  return model;
}

void check_model(const DynamicModel& model) {
  check_tree(model.tree);
  KINESCOPE_CHECK(model.links.size() == model.tree.links.size(), "one inertia a link");
  KINESCOPE_CHECK(model.joints.size() == model.tree.joints.size(), "one friction a joint");
  KINESCOPE_CHECK(model.gravity_m_s2.allFinite(), "gravity is finite");
  for (const InertialParameters& link : model.links) {
    KINESCOPE_CHECK(link.vector().allFinite(), "inertias are finite");
  }
  for (const JointDynamics& joint : model.joints) {
    KINESCOPE_CHECK(std::isfinite(joint.viscous) && std::isfinite(joint.coulomb) &&
                        std::isfinite(joint.motor_inertia),
                    "friction and motor inertia are finite");
  }
}

std::vector<JointId> moving_joints(const KinematicTree& tree) {
  std::vector<JointId> movable;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    if (is_movable(tree.joints[j])) movable.push_back(JointId{static_cast<int>(j)});
  }
  return movable;
}

}  // namespace kinescope
