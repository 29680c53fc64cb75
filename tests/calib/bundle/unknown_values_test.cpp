// SPDX-License-Identifier: Apache-2.0
//
// Calibration without a joint log: the values are unknowns too.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "calib/bundle/calibrate.h"
#include "tests/truth/camera_world.h"

namespace kinescope {
namespace {

TEST(UnknownValues, AxesAndValuesTogether) {
  truth::WorldOptions options;
  options.joints = {JointType::kRevolute, JointType::kPrismatic};
  options.sigma_px = 0.05;
  options.frames = 120;
  const truth::World world = truth::make_world(options);
  CalibrationStart start = truth::perturbed_start(world, 0.01, 0.003, 1);
  for (Joint& joint : start.tree.joints) joint.channel.clear();
  start.joint_values = world.joint_values.array() + 0.01;
  const Calibration found = calibrate(world.measurements, world.markers, {}, start);
  EXPECT_EQ(found.status, CalibrationStatus::kConverged) << found.status_reason;
  EXPECT_NEAR(found.final_rms, std::numbers::sqrt2 * 0.05, 0.005);
  EXPECT_LT(found.held_out_rms / found.training_rms, 1.1);
  // The zero is free: compare changes against the first frame. 4 sigma of a 34 px tag's angle.
  for (Eigen::Index j = 0; j < 2; ++j) {
    const Eigen::VectorXd expected = world.joint_values.col(j).array() - world.joint_values(0, j);
    const Eigen::VectorXd value = found.joint_values.col(j).array() - found.joint_values(0, j);
    const double tolerance = j == 0 ? 0.02 : 0.004;
    EXPECT_LT((expected - value).cwiseAbs().maxCoeff(), tolerance) << j;
  }
  for (const JointEstimate& joint : found.joints) {
    ASSERT_TRUE(joint.direction_sigma_rad);
    EXPECT_LT(*joint.direction_sigma_rad, 0.02);
  }
}

// Of a joint that nothing shows in a frame nothing is known there; and a value found a whole turn
// from the one before is the same posture.
TEST(UnknownValues, AreThoseThatMarkersShow) {
  truth::WorldOptions options;
  options.joints = {JointType::kRevolute, JointType::kRevolute};
  options.frames = 60;
  truth::World world = truth::make_world(options);
  CalibrationStart start = truth::perturbed_start(world, 0.01, 0.003, 1);
  for (Joint& joint : start.tree.joints) joint.channel.clear();
  start.joint_values = world.joint_values.array() + 0.01;
  constexpr int kTurned = 20;
  constexpr int kUnseen = 30;
  start.joint_values(kTurned, 1) -= 2.0 * std::numbers::pi;
  const JointId last{1};
  std::erase_if(world.measurements.corners, [&](const TagObservation& seen) {
    const std::vector<JointId> path = start.tree.path_to(
        start.tree.marker(seen.id) ? start.tree.marker(seen.id)->link : LinkId{});
    return seen.frame == kUnseen && std::ranges::find(path, last) != path.end();
  });
  const Calibration found = calibrate(world.measurements, world.markers, {}, start);
  EXPECT_EQ(found.status, CalibrationStatus::kConverged) << found.status_reason;
  EXPECT_TRUE(std::isnan(found.corrected_values(kUnseen, 1)));
  EXPECT_TRUE(std::isfinite(found.corrected_values(kUnseen, 0)));
  const double shift = found.corrected_values(0, 1) - world.joint_values(0, 1);
  EXPECT_NEAR(found.corrected_values(kTurned, 1) - world.joint_values(kTurned, 1), shift, 0.05);
}

}  // namespace
}  // namespace kinescope
