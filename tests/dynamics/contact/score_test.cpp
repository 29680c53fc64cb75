// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/contact/contact_score.h"
#include "dynamics/contact/momentum_observer.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

TEST(ContactScore, CountsFoundMissedInventedRepeated) {
  const std::vector<ContactLabel> labels{{.begin_s = 1.0, .end_s = 2.0, .link = 3},
                                         {.begin_s = 5.0, .end_s = 6.0, .link = 1},
                                         {.begin_s = 8.0, .end_s = 9.0, .link = 2}};
  const std::vector<DetectedContact> detections{
      {.alarm_s = 0.9, .end_s = 1.5, .onset_s = 0.9, .link = 3},  // before it can be known
      {.alarm_s = 1.01, .end_s = 1.2, .onset_s = 1.0, .link = 3},
      {.alarm_s = 1.5, .end_s = 2.1, .onset_s = 1.5, .link = 3},  // the same again
      {.alarm_s = 5.03, .end_s = 5.9, .onset_s = 5.01, .link = 2}};
  const ContactScore score = score_contacts(labels, detections);
  EXPECT_EQ(score.found, 2);
  EXPECT_EQ(score.missed, 1);
  EXPECT_EQ(score.invented, 1);
  EXPECT_EQ(score.repeated, 1);
  EXPECT_EQ(score.link_right, 1);
  EXPECT_NEAR(score.mean_delay_s, 0.02, 1e-12);
  EXPECT_NEAR(score.worst_delay_s, 0.03, 1e-12);
  EXPECT_NEAR(score.median_end_error_s, 0.1, 1e-12);
  EXPECT_TRUE(std::isnan(score_contacts(labels, {}).median_delay_s));
}

/// A constant external torque through a first-order low-pass: 1 - exp(-gain t).
TEST(MomentumObserver, IsALowPassOfTheExternalTorque) {
  const Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(101, 0.0, 0.1);
  const Eigen::MatrixXd measured = Eigen::MatrixXd::Constant(101, 2, -3.0);
  const std::vector<BalanceSample> samples =
      balance_samples(t, measured, Eigen::MatrixXd::Zero(101, 2));
  const Eigen::MatrixXd observed = observe_momentum(samples, 40.0);
  EXPECT_NEAR(observed(1, 100), 3.0 * (1.0 - std::exp(-4.0)), 1e-12);
  EXPECT_THROW((void)observe_momentum(samples, 0.0), Error);
}

}  // namespace
}  // namespace kinescope
