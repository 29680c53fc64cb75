// SPDX-License-Identifier: Apache-2.0
//
// The control experiments in small: what is learned from one log compensates another motion.
#include <algorithm>

#include <gtest/gtest.h>

#include "dynamics/experiments/barrett_control.h"
#include "dynamics/experiments/wam_control.h"
#include "dynamics/rigid/inverse_dynamics.h"

namespace kinescope::experiments {
namespace {

TEST(BarrettControl, CompensationLearnedOnOneSinusoidServesAnother) {
  BarrettControlOptions options;
  options.learn_s = 20.0;
  options.test_s = 8.0;
  options.kinds = {TorqueModelKind::kParametric};
  const BarrettControlResult result = run_barrett_control(options, 1);
  ASSERT_EQ(result.rows.size(), 4U);
  const BarrettControlRow& before = result.rows.front();
  const BarrettControlRow& after = result.rows.back();
  // The report's robot: 0.06 rad before, 0.005 rad after.
  EXPECT_GT(before.error_rad, 0.04);
  EXPECT_LT(before.error_rad, 0.08);
  EXPECT_LT(after.error_rad, 0.005);
  EXPECT_LT(after.largest_rad, 0.01);
  EXPECT_LT(after.feedback_share, 0.1 * before.feedback_share);
  EXPECT_GT(after.weight, 0.9);
  const BarrettControlResult again = run_barrett_control(options, 2);
  EXPECT_EQ(again.rows.back().q_rad, after.q_rad);
}

TEST(HeldArm, IsTheArmWhoseOtherJointsStandStill) {
  const DynamicModel arm = wam_arm(0.254);
  const RigidModel whole = make_rigid_model(arm);
  const Eigen::VectorXd posture =
      (Eigen::VectorXd(7) << 0.3, -0.5, 0.8, 0.0, 0.4, -0.6, 1.1).finished();
  const RigidModel held = make_rigid_model(held_arm(arm, kWamJoint, posture));
  ASSERT_EQ(held.size(), 1);
  Eigen::VectorXd q = posture;
  Eigen::VectorXd dq = Eigen::VectorXd::Zero(7);
  Eigen::VectorXd ddq = dq;
  q[kWamJoint] = 1.2;
  dq[kWamJoint] = -0.7;
  ddq[kWamJoint] = 3.0;
  const double of_whole = inverse_dynamics(whole, q, dq, ddq)[kWamJoint];
  const double of_held = inverse_dynamics(held, q.segment<1>(kWamJoint), dq.segment<1>(kWamJoint),
                                          ddq.segment<1>(kWamJoint))[0];
  EXPECT_NEAR(of_held, of_whole, 1e-12);
}

TEST(WamControl, ItsWorldIsWhatItSays) {
  const WamControlOptions options;
  const WamWorld world = wam_world(options);
  const RigidModel nominal = make_rigid_model(world.nominal);
  const Plant plant = wam_plant(world, false);
  const Plant loaded = wam_plant(world, true);
  EXPECT_NEAR(
      loaded.rigid.bodies.back().inertia.mass_kg - plant.rigid.bodies.back().inertia.mass_kg,
      options.payload_kg, 1e-12);
  // Masses are wrong, kinematics and motors are not.
  for (std::size_t k = 0; k < nominal.bodies.size(); ++k) {
    EXPECT_NE(nominal.bodies[k].inertia.mass_kg, plant.rigid.bodies[k].inertia.mass_kg);
    EXPECT_EQ(nominal.bodies[k].motor_inertia, plant.rigid.bodies[k].motor_inertia);
    EXPECT_EQ(nominal.bodies[k].p_parent_joint, plant.rigid.bodies[k].p_parent_joint);
    EXPECT_GT(plant.drives[k].coulomb, 0.0);
    EXPECT_EQ(plant.drives[k].width, 0.0);  // it sticks
  }
  const TorqueSamples one = wam_reference(world.nominal, 5.0, 100.0, 1, 1);
  const TorqueSamples two = wam_reference(world.nominal, 5.0, 100.0, 1, 2);
  EXPECT_GT((one.q - two.q).norm(), 0.1 * one.q.norm());
}

}  // namespace
}  // namespace kinescope::experiments
