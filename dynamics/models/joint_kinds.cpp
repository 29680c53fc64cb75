// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/joint_kinds.h"

namespace kinescope::models {

gp::JointKinds joint_kinds(const RigidModel& rigid) {
  gp::JointKinds kinds;
  for (const RigidBody& body : rigid.bodies) {
    kinds.push_back(body.type == JointType::kPrismatic ? gp::JointKind::kPrismatic
                                                       : gp::JointKind::kRevolute);
  }
  return kinds;
}

}  // namespace kinescope::models
