// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/panda.h"

#include <string>

#include "dynamics/experiments/reference_arms.h"

namespace kinescope::experiments {
namespace {

// Joints from `joints` on become fixed.
DynamicModel first_joints(DynamicModel model, int joints) {
  for (std::size_t j = static_cast<std::size_t>(joints); j < model.tree.joints.size(); ++j) {
    model.tree.joints[j].type = JointType::kFixed;
  }
  return model;
}

TorqueSamples noisy_log(const DynamicModel& arm, std::string_view part, int run,
                        std::uint64_t seed) {
  Rng rng = Rng::from_name("panda " + std::string(part) + " " + std::to_string(run), seed);
  TorqueSamples log = panda_log(arm, rng);
  add_white_noise(log, Eigen::RowVectorXd::Constant(log.joints(), kPandaNoise_nm), rng);
  return log;
}

}  // namespace

ComparisonCase panda_case(int joints, int run, std::uint64_t seed) {
  const DynamicModel arm = first_joints(panda_arm(), joints);
  return {first_joints(panda_kinematics(), joints), noisy_log(arm, "train", run, seed),
          noisy_log(arm, "test", run, seed)};
}

}  // namespace kinescope::experiments
