// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gtest/gtest.h>

#include "calib/bundle/calibrate.h"
#include "kinematics/core/rng.h"
#include "tests/truth/axis_errors.h"
#include "tests/truth/camera_world.h"
#include "tests/truth/coverage.h"

namespace kinescope {
namespace {

using truth::Coverage;
using truth::World;

constexpr double kNoise_px = 0.1;

struct Coverages {
  Coverage in_base, among;
  double base_sigma = 0.0, among_sigma = 0.0;  // sums, rad
};

// Noise of each sighting; the base's marker: one error for all of them, of `lasting_px` a
// coordinate, and `flicker_px` on top.
World make_world(std::uint64_t seed, double flicker_px, double lasting_px = kNoise_px) {
  truth::WorldOptions options;
  options.seed = seed;
  options.sigma_px = 0.0;
  World world = truth::make_world(options);
  const auto at_rest = world.tree.markers.front().id;
  Rng rng = Rng::from_name("axis uncertainty", seed);
  std::array<Eigen::Vector2d, 4> lasting;
  for (Eigen::Vector2d& error : lasting) error = {rng.normal(lasting_px), rng.normal(lasting_px)};
  for (TagObservation& seen : world.measurements.corners) {
    seen.sigma_px = kNoise_px;
    const bool rests = seen.id == at_rest && flicker_px < kNoise_px;
    const double sigma = rests ? flicker_px : kNoise_px;
    for (std::size_t c = 0; c < 4; ++c) {
      if (rests) seen.corners_px[c] += lasting[c];
      seen.corners_px[c] += Eigen::Vector2d(rng.normal(sigma), rng.normal(sigma));
    }
  }
  return world;
}

Coverages cover(double flicker_px) {
  Coverages out;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const World world = make_world(seed, flicker_px);
    CalibrateOptions options;
    options.folds = 0;
    const Calibration found = calibrate(world.measurements, world.markers, world.log,
                                        truth::perturbed_start(world, 0.01, 0.002, seed), options);
    const truth::AxisDifferences errors = truth::axis_differences(world.tree, found);
    for (std::size_t j = 0; j < found.joints.size(); ++j) {
      const JointEstimate& joint = found.joints[j];
      out.in_base.add(errors.in_base[j].direction_rad, joint.direction_sigma_rad);
      out.in_base.add(*errors.in_base[j].position_m, joint.position_sigma_m);
      out.among.add(errors.among[j].direction_rad, joint.among_direction_sigma_rad);
      out.among.add(*errors.among[j].position_m, joint.among_position_sigma_m);
      out.base_sigma += joint.direction_sigma_rad.value_or(0.0);
      out.among_sigma += joint.among_direction_sigma_rad.value_or(0.0);
    }
  }
  return out;
}

// Compressed video repeats the pixels of what does not move.
TEST(AxisUncertainty, OneErrorOfAMarkerAtRestIsHeld) {
  const Coverages rests = cover(0.02 * kNoise_px);
  EXPECT_GE(rests.in_base.share(), 0.85);
  EXPECT_LT(rests.in_base.rms(), 1.3);
  EXPECT_GE(rests.among.share(), 0.9);
  EXPECT_LT(rests.among.rms(), 1.2);
  EXPECT_GT(rests.base_sigma, 3.0 * rests.among_sigma);
}

// They change once in a while, and it is not the marker's fault.
TEST(AxisUncertainty, WhatIsOffByNoMoreThanOthersIsNoOutlier) {
  World world = make_world(3, 0.02 * kNoise_px, 0.0);
  const auto at_rest = world.tree.markers.front().id;
  constexpr int kFirst = 20;
  constexpr int kLast = 30;
  for (TagObservation& seen : world.measurements.corners) {
    if (seen.id != at_rest || seen.frame < kFirst || seen.frame > kLast) continue;
    for (std::size_t c = 0; c < 4; ++c)
      seen.corners_px[c] += kNoise_px * Eigen::Vector2d(c % 2 == 0 ? 1.0 : -1.0, 0.5);
  }
  const Calibration found = calibrate(world.measurements, world.markers, world.log,
                                      truth::perturbed_start(world, 0.01, 0.002, 3));
  int rejected = 0;
  for (const SightingResidual& residual : found.residuals) rejected += residual.used ? 0 : 1;
  EXPECT_EQ(rejected, 0);
}

TEST(AxisUncertainty, NoiseOfEverySightingIsHeldAsWell) {
  const Coverages noise = cover(kNoise_px);
  EXPECT_GE(noise.in_base.share(), 0.9);
  EXPECT_GT(noise.in_base.rms(), 0.6);
  EXPECT_LT(noise.in_base.rms(), 1.2);
  EXPECT_GE(noise.among.share(), 0.9);
  EXPECT_GT(noise.among.rms(), 0.6);
  EXPECT_LT(noise.among.rms(), 1.2);
}

}  // namespace
}  // namespace kinescope
