// SPDX-License-Identifier: Apache-2.0
#include "dynamics/simulation/robot_effects.h"

#include <memory>

namespace kinescope {

RobotEffects effects_of_robot(const DynamicModel& model, const TorqueSamples& motion) {
  EffectContext context;
  context.motion =
      std::make_shared<const EffectMotion>(motion, EffectMotionOptions{.every_sample = true});
  context.cache = std::make_shared<ColumnCache>();
  context.rigid = make_rigid_model(model);
  for (const RigidBody& body : context.rigid.bodies) {
    context.joints.push_back(body.joint);
    context.turns.push_back(body.type == JointType::kRevolute ? 1 : 0);
  }
  context.widths = Eigen::VectorXd::Zero(context.rigid.size());
  describe_log(context);
  return {make_candidates(context), context.travels, context.log};
}

}  // namespace kinescope
