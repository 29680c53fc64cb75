// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "app/report/contact_summary.h"
#include "app/report/torque_unit.h"

namespace kinescope::report {
namespace {

TEST(TorqueWords, AContactVerdictGivesTheEstimatedRateOfFalseAlarms) {
  ContactSummary summary;
  summary.calibration.options.false_alarms_per_hour = 1.0;
  summary.check.hours = 20.0 / 3600.0;
  summary.check.extrapolated_per_hour = 3.24;
  EXPECT_EQ(contact_verdict(summary),
            "No contact in 20.0 s (false alarms: 1 an hour asked for, 3.2 estimated).");
}

TEST(TorqueWords, UnitsAreSpelledOneWay) {
  EXPECT_EQ(joint_unit("Nm", JointType::kRevolute), "N m");
  EXPECT_EQ(joint_unit("Nm", JointType::kPrismatic), "N");
  EXPECT_EQ(joint_unit("mNm", JointType::kRevolute), "mN m");
  EXPECT_EQ(joint_unit("A", JointType::kPrismatic), "A");
  EXPECT_EQ(common_unit("Nm", {JointType::kRevolute}), "N m");
  EXPECT_EQ(common_unit("Nm", {JointType::kRevolute, JointType::kPrismatic}),
            "N m (N where a joint slides)");
}

}  // namespace
}  // namespace kinescope::report
