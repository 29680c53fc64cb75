// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/predictive_score.h"

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr int kScoredFrames = 200;

// A model of one body that was seen in every frame, and is off by `sigma_m`.
Calibration off_by(double sigma_m) {
  Rng rng = Rng::from_name("predictive score");
  Calibration out;
  out.kind = MeasurementKind::kPoint;
  for (int f = 0; f < kScoredFrames; ++f) {
    SightingResidual residual;
    residual.frame = f;
    residual.id = TagId{1};
    residual.displacement.tail<3>() = rng.normal3(sigma_m);
    out.residuals.push_back(residual);
    out.times_s.push_back(0.1 * f);
  }
  return out;
}

Measurements seen() {
  Measurements out;
  for (int f = 0; f < kScoredFrames; ++f) {
    PointObservation point;
    point.frame = f;
    point.id = TagId{1};
    point.position_m = Eigen::Vector3d(0.002 * f, 0.0, 0.3);
    out.points.observations.push_back(point);
  }
  return out;
}

double odds(const Calibration& of, const Calibration& against) {
  return log_odds(predictive_score(of, seen()), predictive_score(against, seen()));
}

TEST(PredictiveScore, TheNearerModelIsTheMoreProbable) {
  // Of noise that is known, n d ln(ratio).
  EXPECT_NEAR(odds(off_by(1e-3), off_by(2e-3)), 3.0 * kScoredFrames * std::log(2.0), 1e-6);
  EXPECT_NEAR(odds(off_by(2e-3), off_by(1e-3)), -3.0 * kScoredFrames * std::log(2.0), 1e-6);
}

TEST(PredictiveScore, OneOutlierIsNoReasonToGiveUpAModel) {
  Calibration outlier = off_by(1e-3);
  outlier.residuals[17].displacement.tail<3>() = Eigen::Vector3d(0.4, 0.0, 0.0);
  EXPECT_GT(odds(outlier, off_by(2e-3)), 0.0);
  EXPECT_LT(odds(outlier, off_by(1e-3)), 0.0);
}

TEST(PredictiveScore, WhatAModelHasNoPlaceForMayBeAnywhere) {
  Calibration fewer = off_by(1e-3);
  fewer.residuals.resize(kScoredFrames / 2);
  EXPECT_LT(odds(fewer, off_by(1e-3)), 0.0);
  EXPECT_LT(odds(fewer, off_by(5e-3)), 0.0);
}

TEST(PredictiveScore, AValueThatIsReadOffPredictsNothing) {
  Calibration read_off = off_by(0.9e-3);
  Joint joint;
  joint.type = JointType::kRevolute;
  joint.limits = JointLimits{-1.0, 1.0};
  read_off.tree.joints.push_back(joint);
  EXPECT_LT(odds(read_off, off_by(1e-3)), 0.0);
  read_off.tree.joints[0].channel = "q1";
  EXPECT_GT(odds(read_off, off_by(1e-3)), 0.0);
}

TEST(PredictiveScore, ResidualsThatAreAlikeCountOnce) {
  Calibration near = off_by(1e-3);
  Calibration far = off_by(2e-3);
  near.correlation_time_s = far.correlation_time_s = 1.0;  // ten frames
  EXPECT_NEAR(odds(near, far), 0.1 * odds(off_by(1e-3), off_by(2e-3)), 0.1);
}

}  // namespace
}  // namespace kinescope
