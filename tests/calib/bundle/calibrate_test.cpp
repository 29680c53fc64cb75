// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/calibrate.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "tests/truth/camera_world.h"

namespace kinescope {
namespace {

using truth::make_world;
using truth::perturbed_start;
using truth::World;
using truth::WorldOptions;

// Exact corners leave only the interpolation of the joint log (200 Hz, cubic): far below these.
constexpr double kExactRms = 1e-4;   // px
constexpr double kExactPose = 1e-6;  // rad, m

// How far the calibrated markers are from the true ones in the camera's frame, over the frames.
double worst_marker_error(const World& world, const Calibration& found) {
  double worst = 0.0;
  for (Eigen::Index f = 0; f < world.joint_values.rows(); f += 10) {
    const auto truth_links = forward_kinematics(world.tree, world.joint_values.row(f));
    const auto found_links = forward_kinematics(found.tree, world.joint_values.row(f));
    for (std::size_t m = 0; m < world.tree.markers.size(); ++m) {
      const Marker& a = world.tree.markers[m];
      const Marker& b = found.tree.markers[m];
      const Pose truth = world.T_camera_base * truth_links[a.link.index()] * a.T_link_marker;
      const Pose guess = found.T_camera_base * found_links[b.link.index()] * b.T_link_marker;
      worst = std::max(worst, log_pose(truth.inverse() * guess).norm());
    }
  }
  return worst;
}

WorldOptions mixed_chain() {
  WorldOptions options;
  options.joints = {JointType::kRevolute, JointType::kPrismatic, JointType::kRevolute,
                    JointType::kRevolute};
  return options;
}

TEST(Calibrate, ExactCornersGiveTheExactRobot) {
  WorldOptions options = mixed_chain();
  options.sigma_px = 0.0;
  options.time_offset_s = -0.03;
  const World world = make_world(options);
  const Calibration found = calibrate(world.measurements, world.markers, world.log,
                                      perturbed_start(world, 0.03, 0.01, 1));
  EXPECT_EQ(found.status, CalibrationStatus::kConverged) << found.status_reason;
  EXPECT_LT(found.final_rms, kExactRms);
  EXPECT_GT(found.before_rms, 1.0);
  EXPECT_NEAR(found.time_offset_s, -0.03, 1e-6);
  EXPECT_LT(worst_marker_error(world, found), kExactPose);
}

// Readings that a script writes once a frame, of a robot that moves.
TEST(Calibrate, TheOffsetIsFoundThoughTheLogHasTheFramesStamps) {
  WorldOptions options = mixed_chain();
  options.time_offset_s = -0.03;
  const World world = make_world(options);
  JointLog log = world.log;
  log.times_s = world.measurements.times_s;
  log.values = resample(world.log, log.times_s);
  const Calibration found =
      calibrate(world.measurements, world.markers, log, perturbed_start(world, 0.03, 0.01, 1));
  EXPECT_TRUE(found.time_offset_sigma_s);
  EXPECT_NEAR(found.time_offset_s, -0.03, 1e-3);
}

TEST(Calibrate, WithoutABaseTagTheCameraIsTheBase) {
  WorldOptions options = mixed_chain();
  options.sigma_px = 0.0;
  options.base_tag = false;
  const World world = make_world(options);
  const Calibration found = calibrate(world.measurements, world.markers, world.log,
                                      perturbed_start(world, 0.03, 0.01, 2));
  EXPECT_LT(found.final_rms, kExactRms);
  EXPECT_LT(worst_marker_error(world, found), kExactPose);
}

// The last motor also carries what the one before it turns: its encoder shows the difference.
TEST(Calibrate, AJointThatTwoChannelsMoveIsExact) {
  WorldOptions options = mixed_chain();
  options.sigma_px = 0.0;
  const World world = make_world(options);
  JointLog log = world.log;
  log.values.col(3) -= 0.5 * log.values.col(2);
  CalibrationStart start = perturbed_start(world, 0.03, 0.01, 1);
  start.tree.joints[3].couplings = {{log.channels[2], 0.5}};
  const Calibration found = calibrate(world.measurements, world.markers, log, start);
  EXPECT_LT(found.final_rms, kExactRms);
  EXPECT_LT(worst_marker_error(world, found), kExactPose);
  EXPECT_EQ(found.tree.joints[3].couplings, start.tree.joints[3].couplings);
}

TEST(Calibrate, NoiseComesBackAsNoise) {
  WorldOptions options = mixed_chain();
  options.frames = 300;
  options.sigma_px = 0.1;
  const World world = make_world(options);
  const Calibration found = calibrate(world.measurements, world.markers, world.log,
                                      perturbed_start(world, 0.02, 0.005, 3));
  EXPECT_NEAR(found.final_rms, std::numbers::sqrt2 * 0.1, 0.003);
  EXPECT_NEAR(found.sigma_scale, 1.0, 0.05);
  EXPECT_LT(found.held_out_rms / found.training_rms, 1.05);
  EXPECT_EQ(found.folds, 5);
  for (const JointEstimate& joint : found.joints) ASSERT_TRUE(joint.direction_sigma_rad);
}

// Two models of the same measurements can be asked to predict the same frames.
TEST(Calibrate, FramesAreHeldOutAsTheyAreSaidToBe) {
  constexpr int kFolds = 3;
  const World world = make_world(mixed_chain());
  const CalibrationStart start = perturbed_start(world, 0.02, 0.005, 3);
  CalibrateOptions options;
  options.folds = kFolds;
  for (std::size_t f = 0; f < world.measurements.times_s.size(); ++f)
    options.fold_of_frame.push_back(static_cast<int>(f % kFolds));
  const Calibration found = calibrate(world.measurements, world.markers, world.log, start, options);
  EXPECT_EQ(found.folds, kFolds);
  for (const SightingResidual& residual : found.residuals)
    ASSERT_EQ(residual.fold, residual.frame % kFolds);
  options.fold_of_frame.clear();
  const Calibration by_posture =
      calibrate(world.measurements, world.markers, world.log, start, options);
  EXPECT_EQ(found.final_rms, by_posture.final_rms);
  EXPECT_NE(found.held_out_rms, by_posture.held_out_rms);
}

TEST(Calibrate, OutliersAreListedAndDoNotMove) {
  WorldOptions options = mixed_chain();
  options.outliers = 0.03;
  const World world = make_world(options);
  ASSERT_GT(world.outliers.size(), 5U);
  const Calibration found = calibrate(world.measurements, world.markers, world.log,
                                      perturbed_start(world, 0.02, 0.005, 4));
  int rejected = 0;
  for (const SightingResidual& residual : found.residuals) rejected += residual.used ? 0 : 1;
  EXPECT_GE(rejected, static_cast<int>(world.outliers.size()));
  EXPECT_LE(rejected, static_cast<int>(world.outliers.size()) + 4);
  EXPECT_NEAR(found.final_rms, std::numbers::sqrt2 * 0.1, 0.005);
}

TEST(Calibrate, ShuffledInputGivesTheSameBits) {
  const World world = make_world(mixed_chain());
  Measurements shuffled = world.measurements;
  Rng rng = Rng::from_name("shuffle");
  for (std::size_t i = shuffled.corners.size(); i > 1; --i) {
    std::swap(shuffled.corners[i - 1],
              shuffled.corners[static_cast<std::size_t>(rng.index(static_cast<int>(i)))]);
  }
  const CalibrationStart start = perturbed_start(world, 0.02, 0.005, 5);
  const Calibration a = calibrate(world.measurements, world.markers, world.log, start);
  const Calibration b = calibrate(shuffled, world.markers, world.log, start);
  EXPECT_EQ(a.final_cost, b.final_cost);
  EXPECT_EQ(a.held_out_rms, b.held_out_rms);
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.tree.joints.back().T_parent_joint.translation,
            b.tree.joints.back().T_parent_joint.translation);
}

TEST(Calibrate, NothingSeenIsRefused) {
  const World world = make_world(mixed_chain());
  JointLog elsewhere = world.log;
  for (double& t : elsewhere.times_s) t += 1e4;
  EXPECT_THROW(static_cast<void>(calibrate(world.measurements, world.markers, elsewhere,
                                           perturbed_start(world, 0.01, 0.001, 6))),
               Error);
}

TEST(Calibrate, IntrinsicsOnRequest) {
  WorldOptions options = mixed_chain();
  options.frames = 300;
  options.sigma_px = 0.05;
  World world = make_world(options);
  CalibrationStart start = perturbed_start(world, 0.02, 0.005, 7);
  start.camera.fx = start.camera.fy = 880.0;
  start.camera.cx += 5.0;
  start.camera.distortion = {};
  CalibrateOptions calibrate_options;
  calibrate_options.estimate_intrinsics = true;
  const Calibration found =
      calibrate(world.measurements, world.markers, world.log, start, calibrate_options);
  ASSERT_TRUE(found.intrinsics_sigma[0]);
  EXPECT_LT(std::abs(found.camera.fx - world.camera.fx), 4.0 * *found.intrinsics_sigma[0]);
  EXPECT_LT(std::abs(found.camera.cx - world.camera.cx), 4.0 * *found.intrinsics_sigma[2]);
  EXPECT_NEAR(found.final_rms, std::numbers::sqrt2 * 0.05, 0.003);
}

// Claimed uncertainty against scatter: z-scores of quantities that do not depend on the gauge (the
// axis of each joint in the camera's frame is carried by base, frames and mounts together; a
// marker's predicted image is simplest of all) must have unit variance. Here: time offset, and the
// distance between two markers.
TEST(Calibrate, IntervalsCoverTheTruth) {
  constexpr int kWorlds = 40;
  int covered_offset = 0;
  double sum_offset = 0.0;
  for (int seed = 0; seed < kWorlds; ++seed) {
    WorldOptions options;
    options.seed = 1000 + static_cast<std::uint64_t>(seed);
    options.frames = 100;
    options.time_offset_s = 0.01;
    const World world = make_world(options);
    CalibrateOptions calibrate_options;
    calibrate_options.folds = 0;
    const Calibration found =
        calibrate(world.measurements, world.markers, world.log,
                  perturbed_start(world, 0.01, 0.002, options.seed), calibrate_options);
    ASSERT_TRUE(found.time_offset_sigma_s);
    const double z = (found.time_offset_s - 0.01) / *found.time_offset_sigma_s;
    sum_offset += z * z;
    covered_offset += std::abs(z) < 1.96 ? 1 : 0;
  }
  // 95 % of 40: between 34 and 40 with probability 0.99.
  EXPECT_GE(covered_offset, 34);
  EXPECT_LT(sum_offset / kWorlds, 1.6);
  EXPECT_GT(sum_offset / kWorlds, 0.4);
}

}  // namespace
}  // namespace kinescope
