// SPDX-License-Identifier: Apache-2.0
#include "app/report/analysis.h"

#include <cmath>

#include <gtest/gtest.h>

#include "app/report/prediction.h"
#include "kinematics/core/rng.h"
#include "tests/app/report/synthetic_run.h"

namespace kinescope::report {
namespace {

TEST(QuantileBins, HaveEqualCountsAndRightMeans) {
  std::vector<std::pair<double, double>> pairs;
  for (int k = 99; k >= 0; --k) pairs.emplace_back(k, 2.0 * k);
  const auto bins = quantile_bins(pairs, 10);
  ASSERT_EQ(bins.size(), 10U);
  EXPECT_EQ(bins[0].count, 10);
  EXPECT_DOUBLE_EQ(bins[0].centre, 4.5);
  EXPECT_DOUBLE_EQ(bins[0].mean, 9.0);
  EXPECT_DOUBLE_EQ(bins[9].median, 189.0);
  EXPECT_TRUE(quantile_bins({{1.0, 1.0}}, 10).empty());
}

TEST(Share, IsZeroForNoiseAndOneForACurve) {
  Rng rng = Rng::from_name("explained share");
  std::vector<std::pair<double, double>> noise, curve, half;
  for (int k = 0; k < 2000; ++k) {
    const double x = rng.uniform(0.0, 1.0);
    const double e = rng.normal();
    noise.emplace_back(x, e);
    curve.emplace_back(x, std::floor(10.0 * x));
    half.emplace_back(x, (x < 0.5 ? 1.0 : -1.0) + e);
  }
  constexpr double kChance = 0.02;  // three standard deviations of the share at 2000 samples
  EXPECT_NEAR(*share_of_value(noise, 10), 0.0, kChance);
  EXPECT_GT(*share_of_value(curve, 10), 0.95);
  EXPECT_NEAR(*share_of_value(half, 10), 0.5, 0.05);
  EXPECT_FALSE(share_of_value({{0.0, 1.0}, {1.0, 2.0}}, 10).has_value());
}

TEST(Share, IsNotFooledByNoiseThatIsAlikeOverTime) {
  // A joint that swings, and a residual that wanders on its own: binned, the plain share is far
  // from zero.
  double largest = 0.0, sum = 0.0;
  constexpr int kRepeats = 40;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    Rng rng = Rng::from_name("wandering residual", static_cast<std::uint64_t>(repeat));
    std::vector<std::pair<double, double>> pairs;
    double wander = 0.0;
    for (int k = 0; k < 330; ++k) {
      wander = 0.94 * wander + rng.normal();
      pairs.emplace_back(std::sin(0.031 * k) + 0.6 * std::sin(0.017 * k + 1.0), wander);
    }
    const double share = *share_of_value(pairs, 10);
    largest = std::max(largest, share);
    sum += share;
  }
  EXPECT_LT(sum / kRepeats, 0.12);
  EXPECT_LT(largest, 0.6);
}

TEST(Share, FindsASmoothErrorOfASwingingJoint) {
  // The error itself makes the residual alike over time; that must not hide it.
  Rng rng = Rng::from_name("smooth error");
  std::vector<std::pair<double, double>> pairs;
  for (int k = 0; k < 330; ++k) {
    const double q = std::sin(0.031 * k) + 0.6 * std::sin(0.017 * k + 1.0);
    pairs.emplace_back(q, std::sin(3.0 * q) + rng.normal(0.1));
  }
  EXPECT_GT(*share_of_value(pairs, 10), 0.7);
}

TEST(Share, OfTimeSeesADrift) {
  Rng rng = Rng::from_name("drift");
  std::vector<std::pair<double, double>> still, drift;
  for (int k = 0; k < 400; ++k) {
    const double e = rng.normal();
    still.emplace_back(k / 30.0, e);
    drift.emplace_back(k / 30.0, e + 0.01 * k);
  }
  EXPECT_LT(*share_of_time(still, 10), 0.06);
  EXPECT_NEAR(*share_of_time(drift, 10), 0.57, 0.1);  // 4^2 / 12 over 4^2 / 12 + 1
}

TEST(Predictor, RatesAreTheDerivativeOfThePrediction) {
  for (const auto kind :
       {MeasurementKind::kCorners, MeasurementKind::kPose, MeasurementKind::kPoint}) {
    const RunSummary run = synthetic_run({.kind = kind, .frames = 20});
    constexpr double kStep = 1e-6;
    constexpr double kTolerance = 1e-3;  // px or m per rad or m; the second difference at that step
    for (const SightingResidual& sighting : run.calibration.residuals) {
      for (std::size_t joint = 0; joint < 3; ++joint) {
        Calibration moved = run.calibration;
        moved.joint_values(sighting.frame, static_cast<Eigen::Index>(joint)) += kStep;
        const Predictor before(run.calibration), after(moved);
        const auto rates = before.rates(sighting, joint);
        const Marker& marker = *run.calibration.tree.marker(sighting.id);
        if (marker.link.value <= static_cast<int>(joint)) {
          EXPECT_TRUE(rates.empty());
          continue;
        }
        if (kind == MeasurementKind::kCorners) {
          ASSERT_EQ(rates.size(), 8U);
          const auto a = before.corners(sighting), b = after.corners(sighting);
          for (std::size_t k = 0; k < 8; ++k) {
            const auto axis = static_cast<Eigen::Index>(k % 2);
            EXPECT_NEAR(rates[k].rate, (b[k / 2](axis) - a[k / 2](axis)) / kStep, kTolerance * 10);
          }
          continue;
        }
        ASSERT_EQ(rates.size(), 3U);
        const Pose T0 = before.links(sighting.frame)[marker.link.index()] * marker.T_link_marker;
        const Pose T1 = after.links(sighting.frame)[marker.link.index()] * marker.T_link_marker;
        Eigen::Vector3d rate = (T1.translation - T0.translation) / kStep;
        rate = kind == MeasurementKind::kPose
                   ? Eigen::Vector3d(T0.rotation.conjugate() * rate)
                   : Eigen::Vector3d(run.calibration.T_camera_base.rotation * rate);
        for (std::size_t k = 0; k < 3; ++k) {
          EXPECT_NEAR(rates[k].rate, rate(static_cast<Eigen::Index>(k)), kTolerance);
        }
      }
    }
  }
}

TEST(Analyse, FindsTheErrorOfOneJointWithItsSize) {
  constexpr double kGearError = 0.002;  // rad
  const RunSummary run = synthetic_run({.gear_error_rad = kGearError});
  const Analysis analysis = analyse(run);
  ASSERT_FALSE(analysis.dependence.empty());
  EXPECT_EQ(analysis.dependence.front().on, "q2");
  EXPECT_GT(analysis.dependence.front().explained, 0.5);
  // Mean curve of bins over sin(3 q): close to the amplitude, never above it by more than the
  // noise.
  EXPECT_NEAR(analysis.dependence.front().half_range, kGearError, 0.2 * kGearError);
  // Sign: a joint that truly stands further shows a positive error.
  for (const JointError& one : analysis.joint_errors[1]) {
    const double expected = kGearError * std::sin(3.0 * one.value);
    EXPECT_NEAR(one.error, expected, 0.0012) << one.value;
  }
}

TEST(Analyse, FindsNothingInNoise) {
  const Analysis analysis = analyse(synthetic_run());
  for (const Dependence& one : analysis.dependence) EXPECT_LT(one.explained, 0.1) << one.on;
  EXPECT_NEAR(analysis.outside_two_sigma, 0.0455, 0.01);
  EXPECT_GT(analysis.image_coverage, 0.05);
}

TEST(Analyse, CornersLieWhereTheyWereSeen) {
  const RunSummary run = synthetic_run({.frames = 10});
  const Analysis analysis = analyse(run);
  const Predictor predictor(run.calibration);
  const SightingResidual* first = nullptr;
  for (const SightingResidual& sighting : run.calibration.residuals) {
    if (sighting.used && first == nullptr) first = &sighting;
  }
  ASSERT_NE(first, nullptr);
  const Eigen::Vector2d expected = predictor.corners(*first)[0] + first->corners_px[0];
  EXPECT_NEAR((analysis.corners.front().pixel - expected).norm(), 0.0, 1e-12);
}

}  // namespace
}  // namespace kinescope::report
