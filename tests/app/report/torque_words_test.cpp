// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "app/report/contact_summary.h"
#include "app/report/torque_summary.h"
#include "app/report/torque_unit.h"
#include "tests/app/report/synthetic_run.h"

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

TEST(TorqueWords, ParametersThatDoNotMoveAreNamedInWords) {
  TorqueSummary summary;
  summary.joints = {"j1"};
  summary.types = {JointType::kRevolute};
  TorqueScore& score = summary.scores.emplace_back();
  score.nmse_percent = score.rms = Eigen::VectorXd::Ones(1);
  score.coverage_95 = Eigen::VectorXd::Constant(1, 0.95);
  summary.identification.names = {"mcx(link2) + 0.15 m(link3)"};
  summary.identification.undetermined = {0};
  const auto limits = [&] { return torque_verdict(summary).limits; };
  EXPECT_TRUE(has(limits(), "the first being the centre of mass along x of link2: record"))
      << limits();
  summary.identification.names = {"Ixz(link2)"};
  EXPECT_TRUE(has(limits(), "the first being the inertia Ixz of link2: record")) << limits();
  summary.identification.names = {"motor_inertia(j1)"};
  EXPECT_TRUE(has(limits(), "the first being the motor inertia of j1: record")) << limits();
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
