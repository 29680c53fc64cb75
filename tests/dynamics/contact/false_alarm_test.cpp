// SPDX-License-Identifier: Apache-2.0
//
// The declared rate of false alarms against the counted one, over long free motion.
#include <gtest/gtest.h>

#include "dynamics/contact/contact.h"
#include "dynamics/experiments/contact_world.h"

namespace kinescope {
namespace {

using namespace experiments;

std::vector<BalanceSample> free_motion(const DynamicModel& model, double duration_s, Rng& rng) {
  const ContactWorld world =
      contact_world(model, {.duration_s = duration_s, .rate_hz = 250.0}, rng);
  return balance_samples(RigidBalance(make_rigid_model(model), friction_of(model)), world.samples);
}

TEST(FalseAlarms, AreAsDeclared) {
  const DynamicModel model = contact_arm(2);
  Rng rng = Rng::from_name("contact.false_alarms");
  constexpr double kDeclared_per_hour = 180.0;
  int alarms = 0;
  double hours = 0.0;
  double extrapolated = 0.0;
  for (int round = 0; round < 6; ++round) {
    const ContactCalibration calibration = calibrate_contacts(
        free_motion(model, 40.0, rng), {.false_alarms_per_hour = kDeclared_per_hour});
    const FalseAlarmCheck check = check_false_alarms(calibration, free_motion(model, 150.0, rng));
    alarms += check.alarms;
    hours += check.hours;
    extrapolated += check.extrapolated_per_hour / 6.0;
    EXPECT_EQ(check.declared_per_hour, kDeclared_per_hour);
    EXPECT_LE(check.lower_per_hour, check.observed_per_hour);
    EXPECT_GE(check.upper_per_hour, check.observed_per_hour);
  }
  // 45 alarms are expected. Each calibration knows its own rate within a factor of about 1.7 from
  // 40 s, six of them within 1.25; with the count's own spread four sigma are a factor of 2.2.
  const double expected = kDeclared_per_hour * hours;
  RecordProperty("alarms", alarms);
  EXPECT_GT(alarms, expected / 2.2);
  EXPECT_LT(alarms, expected * 2.2);
  EXPECT_GT(extrapolated, kDeclared_per_hour / 2.2);
  EXPECT_LT(extrapolated, kDeclared_per_hour * 2.2);
}

/// Raising the declared rate lowers all thresholds.
TEST(FalseAlarms, ThresholdsFollowTheDeclaredRate) {
  const DynamicModel model = contact_arm(2);
  Rng rng = Rng::from_name("contact.thresholds");
  const std::vector<BalanceSample> samples = free_motion(model, 40.0, rng);
  const ContactCalibration rare = calibrate_contacts(samples, {.false_alarms_per_hour = 0.1});
  const ContactCalibration often = calibrate_contacts(samples, {.false_alarms_per_hour = 100.0});
  EXPECT_TRUE((rare.thresholds.array() > often.thresholds.array()).all());
}

}  // namespace
}  // namespace kinescope
