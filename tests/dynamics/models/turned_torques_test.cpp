// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/turned_torques.h"

#include <gtest/gtest.h>

#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

struct World {
  DynamicModel model;
  TorqueSamples samples;
};

World world(int joints) {
  Rng rng = Rng::from_name("turned torques");
  World out;
  out.model = random_masses(random_robot({.joints = joints, .prismatic_share = 0.0}, rng).tree,
                            {.motors = true}, rng);
  out.samples = torque_log_of(out.model, {.samples = 1000}, rng);
  return out;
}

TEST(TurnedTorques, AreNamedWhateverTheMassesAre) {
  for (const std::vector<int>& turned : std::vector<std::vector<int>>{{}, {1}, {2}, {0, 3}}) {
    World arm = world(5);
    for (const int joint : turned) arm.samples.torque.col(joint) *= -1.0;
    for (InertialParameters& link : arm.model.links) link = {};
    EXPECT_EQ(find_turned_torques(arm.model, arm.samples, {}), turned);
  }
}

TEST(TurnedTorques, AllTurnedAgreeWithEachOther) {
  World arm = world(3);
  EXPECT_LT(evidence_of_turning(arm.model, arm.samples, {}, {0}), -clear_evidence(3));
  EXPECT_NEAR(evidence_of_turning(arm.model, arm.samples, {}, {0, 1, 2}), 0.0, 1.0);
  arm.samples.torque *= -1.0;
  EXPECT_TRUE(find_turned_torques(arm.model, arm.samples, {}).empty());
}

// Of two, which one it is only masses say.
TEST(TurnedTorques, OneOfTwoIsNotNamed) {
  World arm = world(2);
  arm.samples.torque.col(0) *= -1.0;
  EXPECT_TRUE(find_turned_torques(arm.model, arm.samples, {}).empty());
  EXPECT_GT(evidence_of_turning(arm.model, arm.samples, {}, {0}), clear_evidence(2));
}

}  // namespace
}  // namespace kinescope
