// SPDX-License-Identifier: Apache-2.0
//
// Contacts that last while friction, or a torque that passes through zero, hides them.
#include <algorithm>

#include <gtest/gtest.h>

#include "dynamics/contact/contact.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

/// One joint at 100 Hz with noise of 0.1 N m; `stuck`: where its friction takes all but what is in
/// `torque` there.
std::vector<BalanceSample> joint_samples(const Eigen::VectorXd& torque,
                                         const std::vector<TimeSpan>& stuck) {
  Rng rng = Rng::from_name("contact.stuck");
  std::vector<BalanceSample> out;
  for (Eigen::Index k = 0; k < torque.size(); ++k) {
    const double t_s = 0.01 * static_cast<double>(k);
    const bool sticks = std::ranges::any_of(
        stuck, [&](const TimeSpan& span) { return t_s >= span.begin_s && t_s < span.end_s; });
    const double noise = rng.normal(0.1);
    out.push_back({.stamp_s = t_s,
                   .momentum = Eigen::VectorXd::Zero(1),
                   .drive = Eigen::VectorXd::Constant(1, torque[k] + (sticks ? 0.0 : noise)),
                   .velocity = {},
                   .mass = {},
                   .sigma = Eigen::VectorXd::Ones(1),
                   .sticks = Eigen::VectorXi::Constant(1, sticks ? 1 : 0)});
  }
  return out;
}

ContactCalibration joint_calibration() {
  return calibrate_contacts(joint_samples(Eigen::VectorXd::Zero(6000), {}));
}

/// While the joint that carries it sticks, its friction may hide a contact.
TEST(HeldContact, AContactGoesOnBehindFriction) {
  Eigen::VectorXd torque = Eigen::VectorXd::Zero(6000);
  torque.segment(3000, 500).array() += 0.7;
  torque.segment(3200, 50).setZero();
  const auto events =
      detect_contacts(joint_calibration(), joint_samples(torque, {{31.95, 32.5}, {40.0, 41.0}}));
  ASSERT_EQ(events.size(), 1U);
  EXPECT_NEAR(events[0].onset_s, 30.0, 0.05);
  EXPECT_NEAR(events[0].end_s, 35.0, 0.05);
}

/// Those that a joint at rest feels beyond its friction, and one that pushes the other way as it
/// slides, are contacts of their own; so is one after the joint has slid freely.
TEST(HeldContact, ContactsOfTheirOwnStaySo) {
  Eigen::VectorXd torque = Eigen::VectorXd::Zero(6000);
  torque.segment(3000, 50).array() += 0.7;
  torque.segment(3100, 50).array() += 0.7;
  torque.segment(3200, 50).array() -= 0.7;
  torque.segment(3400, 50).array() -= 0.7;
  const auto events = detect_contacts(joint_calibration(), joint_samples(torque, {{29.0, 32.0}}));
  ASSERT_EQ(events.size(), 4U);
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(events[k].onset_s, 30.0 + static_cast<double>(k), 0.05);
  EXPECT_NEAR(events[3].onset_s, 34.0, 0.05);
}

/// A load that is known to last is one contact, where its torque is none for a while, too.
TEST(HeldContact, AKnownLoadIsOneContact) {
  Eigen::VectorXd torque = Eigen::VectorXd::Zero(6000);
  torque.segment(3050, 950).array() += 0.7;
  torque.segment(3300, 200).setZero();
  const auto samples = joint_samples(torque, {});
  EXPECT_EQ(detect_contacts(joint_calibration(), samples).size(), 2U);
  const auto events = detect_contacts(joint_calibration(), samples, {{30.0, 40.0}});
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].onset_s, 30.0);
  EXPECT_NEAR(events[0].end_s, 40.0, 0.05);
}

}  // namespace
}  // namespace kinescope
