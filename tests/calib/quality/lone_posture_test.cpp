// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/lone_posture.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

// Points that a fit without them predicts to 1 mm.
Calibration of_postures(int count) {
  Calibration out;
  out.kind = MeasurementKind::kPoint;
  out.folds = 5;
  for (int k = 0; k < count; ++k) {
    SightingResidual one;
    one.frame = k;
    one.held_out_displacement << 0.0, 0.0, 0.0, 1e-3, 0.0, 0.0;
    out.times_s.push_back(k);
    out.residuals.push_back(one);
  }
  return out;
}

TEST(LonePosture, IsTheOneThatOutweighsAllOthers) {
  Calibration calibration = of_postures(50);
  EXPECT_FALSE(lone_posture(calibration));
  calibration.residuals[17].held_out_displacement[5] = 0.3;
  const auto alone = lone_posture(calibration);
  ASSERT_TRUE(alone);
  EXPECT_EQ(alone->time_s, 17.0);
  EXPECT_NEAR(alone->of_it.held_out_m.rms, 0.3, 1e-5);
  EXPECT_NEAR(alone->of_others.held_out_m.rms, 1e-3, 1e-12);
  // Two of them are a kind of posture.
  calibration.residuals[40].held_out_displacement[5] = 0.3;
  EXPECT_FALSE(lone_posture(calibration));
}

TEST(LonePosture, IsNoneThatWasRejectedAndNoneOfAHandful) {
  Calibration calibration = of_postures(50);
  calibration.residuals[17].held_out_displacement[5] = 0.3;
  calibration.residuals[17].used = false;
  EXPECT_FALSE(lone_posture(calibration));
  calibration = of_postures(6);
  calibration.residuals[3].held_out_displacement[5] = 0.3;
  EXPECT_FALSE(lone_posture(calibration));
  calibration = of_postures(50);
  calibration.residuals[17].held_out_displacement[5] = 0.3;
  calibration.folds = 0;
  EXPECT_FALSE(lone_posture(calibration));
}

}  // namespace
}  // namespace kinescope
