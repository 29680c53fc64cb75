// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/gravity_from_torques.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/pose.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

// Of the sphere: what torques with 1 % of noise leave open.
constexpr double kTolerance = 0.02;  // rad

struct Mounted {
  DynamicModel model;  ///< as it stands
  TorqueSamples log;
};

Mounted arm_on(const Eigen::Vector3d& down, const std::string& name) {
  Rng rng = Rng::from_name(name);
  Mounted out;
  out.model = random_masses(random_robot({.joints = 5, .prismatic_share = 0.0}, rng).tree, {}, rng);
  out.model.gravity_m_s2 = 9.81 * down.normalized();
  out.log = torque_log_of(out.model, {.samples = 1500}, rng);
  return out;
}

// The model believes that the base stands upright.
GravityFromTorques seen(const Mounted& mounted) {
  DynamicModel upright = mounted.model;
  upright.gravity_m_s2 = {0.0, 0.0, -9.81};
  return gravity_from_torques(upright, mounted.log);
}

TEST(GravityFromTorques, AWallACeilingASlopeAreSeen) {
  int number = 0;
  for (const Eigen::Vector3d& down :
       {Eigen::Vector3d(1.0, 0.0, 0.0), Eigen::Vector3d(0.0, 0.7, 0.7),
        Eigen::Vector3d(-0.2, 0.5, -0.8)}) {
    const Mounted mounted = arm_on(down, "gravity from torques " + std::to_string(++number));
    const GravityFromTorques found = seen(mounted);
    const double off = std::acos(std::min(1.0, found.direction.dot(down.normalized())));
    EXPECT_LT(off, kTolerance) << number;
    EXPECT_TRUE(found.contradicts()) << number;
    EXPECT_LT(found.error_ratio, 0.5) << number;
  }
}

TEST(GravityFromTorques, ABaseThatStandsUprightStays) {
  const GravityFromTorques found = seen(arm_on({0.0, 0.0, -1.0}, "gravity upright"));
  EXPECT_LT(found.from_model_rad, kTolerance);
  EXPECT_FALSE(found.contradicts());
}

// Vertical axes carry no weight: no torque says where it points.
TEST(GravityFromTorques, TorquesThatDoNotCareContradictNothing) {
  Rng rng = Rng::from_name("gravity without a word");
  Mounted mounted;
  RandomRobot robot = random_robot({.joints = 2, .prismatic_share = 0.0}, rng);
  for (Joint& joint : robot.tree.joints) {
    joint.T_parent_joint.rotation.setIdentity();
    joint.axis = Eigen::Vector3d::UnitZ();
  }
  mounted.model = random_masses(robot.tree, {}, rng);
  mounted.model.gravity_m_s2 = {0.0, 0.0, -9.81};
  mounted.log = torque_log_of(mounted.model, {.samples = 1000}, rng);
  EXPECT_FALSE(seen(mounted).contradicts());
}

}  // namespace
}  // namespace kinescope
