// SPDX-License-Identifier: Apache-2.0
//
// Hand-eye calibration of simulated hands: named right, exact without noise, intervals that hold.
#include "calib/hand_eye/hand_eye.h"

#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "tests/truth/hand_eye_world.h"

namespace kinescope {
namespace {

using truth::HandEyeWorld;
using truth::HandEyeWorldOptions;
using truth::make_hand_eye_world;

HandEyeOptions untraced() {
  HandEyeOptions out;
  out.trace = false;
  return out;
}

std::string refusal(const HandEyeWorldOptions& options) {
  try {
    static_cast<void>(calibrate_hand_eye(make_hand_eye_world(options).input, untraced()));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kUndetermined);
    return error.what();
  }
  return "";
}

struct NamedCase {
  CameraMount mount;
  PoseDirection direction;
  bool corners;
};

class EveryReading : public testing::TestWithParam<NamedCase> {};

// Rounding through pixels of 1000 and least squares.
constexpr double kExact = 1e-7;

TEST_P(EveryReading, IsExactWithoutNoiseAndNamedRight) {
  HandEyeWorldOptions options;
  options.mount = GetParam().mount;
  options.direction = GetParam().direction;
  options.corners = GetParam().corners;
  options.targets = 2;
  options.sigma_px = options.flange_sigma_m = options.flange_sigma_rad = 0.0;
  options.pose_sigma_m = options.pose_sigma_rad = 0.0;
  const HandEyeWorld world = make_hand_eye_world(options);
  const HandEye result = calibrate_hand_eye(world.input, untraced());
  EXPECT_EQ(result.hypothesis.mount, options.mount);
  EXPECT_EQ(result.hypothesis.direction, options.direction);
  EXPECT_LT(log_pose(result.camera.T.inverse() * world.camera).norm(), kExact);
  ASSERT_EQ(result.targets.size(), world.targets.size());
  for (std::size_t k = 0; k < world.targets.size(); ++k)
    EXPECT_LT(log_pose(result.targets[k].pose.T.inverse() * world.targets[k]).norm(), kExact);
  EXPECT_LT(result.held_out.m, kExact);
  EXPECT_TRUE(result.odd_rows.empty());
}

TEST_P(EveryReading, IsNamedRightInNoise) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    HandEyeWorldOptions options;
    options.seed = seed;
    options.mount = GetParam().mount;
    options.direction = GetParam().direction;
    options.corners = GetParam().corners;
    const HandEye result = calibrate_hand_eye(make_hand_eye_world(options).input, untraced());
    EXPECT_EQ(result.hypothesis.mount, options.mount) << "seed " << seed;
    EXPECT_EQ(result.hypothesis.direction, options.direction) << "seed " << seed;
    // The other two readings are wrong by far, not by chance.
    ASSERT_EQ(result.rivals.size(), 3U);
    EXPECT_TRUE(result.rivals[1].same_equation);
    EXPECT_LT(result.rivals[2].log_score, -20.0);
  }
}

INSTANTIATE_TEST_SUITE_P(
    HandEye, EveryReading,
    testing::Values(NamedCase{CameraMount::kOnHand, PoseDirection::kBaseFlange, true},
                    NamedCase{CameraMount::kOnHand, PoseDirection::kFlangeBase, true},
                    NamedCase{CameraMount::kFixed, PoseDirection::kBaseFlange, true},
                    NamedCase{CameraMount::kFixed, PoseDirection::kFlangeBase, true},
                    NamedCase{CameraMount::kOnHand, PoseDirection::kBaseFlange, false},
                    NamedCase{CameraMount::kFixed, PoseDirection::kBaseFlange, false}));

// Squared error of the camera's pose by its claimed covariance, and how many of its six numbers lie
// within two sigmas.
struct Claim {
  double squared = 0.0;
  int within = 0;
};

Claim claim_of(const HandEyeWorldOptions& options) {
  const HandEyeWorld world = make_hand_eye_world(options);
  const HandEye result = calibrate_hand_eye(world.input, untraced());
  const Vector6d d = log_pose(result.camera.T.inverse() * world.camera);
  Claim out{d.dot(solve_symmetric(result.camera.covariance, d)), 0};
  for (Eigen::Index k = 0; k < 6; ++k)
    if (std::abs(d[k]) < 2.0 * std::sqrt(result.camera.covariance(k, k))) ++out.within;
  return out;
}

void expect_coverage(HandEyeWorldOptions options) {
  constexpr int kWorlds = 100;
  double squared = 0.0;
  int within = 0;
  for (int k = 1; k <= kWorlds; ++k) {
    options.seed = static_cast<std::uint64_t>(k);
    const Claim claim = claim_of(options);
    squared += claim.squared / kWorlds;
    within += claim.within;
  }
  // 95.4 % of 600, which are correlated six by six: four standard deviations are less than 5 %.
  const double share = within / (6.0 * kWorlds);
  EXPECT_GT(share, 0.90);
  EXPECT_LT(share, 0.99);
  // Chi-square of six, mean of 100: 6 +- 0.35, wider by the variances that are estimated, too.
  EXPECT_GT(squared, 4.5);
  EXPECT_LT(squared, 8.0);
}

TEST(HandEyeCoverage, HoldsWhereTheControllerErrs) { expect_coverage({}); }

TEST(HandEyeCoverage, HoldsWhereTheCameraErrs) {
  HandEyeWorldOptions options;
  options.mount = CameraMount::kFixed;
  options.sigma_px = 1.0;
  options.flange_sigma_m = options.flange_sigma_rad = 1e-6;
  expect_coverage(options);
}

TEST(HandEyeCoverage, HoldsOfPosesWhoseSigmasAreNotDeclaredRight) {
  HandEyeWorldOptions options;
  options.corners = false;
  options.poses = 15;
  options.targets = 2;
  expect_coverage(options);
}

TEST(HandEyeCoverage, HoldsOfThePosesWithoutTheControllersError) {
  HandEyeWorldOptions options;
  options.corners = false;
  options.pose_sigma_m = 2e-3;
  options.pose_sigma_rad = 2e-2;
  expect_coverage(options);
}

TEST(HandEye, TheNoiseIsOfItsSize) {
  HandEyeWorldOptions options;
  options.poses = 200;
  const HandEye result = calibrate_hand_eye(make_hand_eye_world(options).input, untraced());
  // 200 poses of three axes know a standard deviation to 3 %.
  EXPECT_NEAR(result.flange_noise_m, options.flange_sigma_m, 0.12 * options.flange_sigma_m);
  EXPECT_NEAR(result.flange_noise_rad, options.flange_sigma_rad, 0.12 * options.flange_sigma_rad);
  EXPECT_NEAR(result.camera_noise, 1.0, 0.1);
}

TEST(HandEye, AWrongRowIsNamedWithWhatTheMarkersSay) {
  HandEyeWorldOptions options;
  options.wrong_row = 7;
  const HandEyeWorld world = make_hand_eye_world(options);
  const HandEye result = calibrate_hand_eye(world.input, untraced());
  ASSERT_EQ(result.odd_rows.size(), 1U);
  const OddFlangeRow& row = result.odd_rows.front();
  EXPECT_EQ(row.time_s, 7.0);
  EXPECT_NEAR(row.shift_m, 0.02, 2e-3);
  EXPECT_NEAR((row.read.translation - row.expected.translation).y(), 0.02, 2e-3);
}

TEST(HandEye, OneAxisOfRotationIsRefusedByName) {
  HandEyeWorldOptions options;
  options.one_axis = true;
  const std::string words = refusal(options);
  EXPECT_NE(words.find("one axis only, (0.00, 0.00, 1.00)"), std::string::npos) << words;
  EXPECT_NE(words.find("position of the camera along that axis"), std::string::npos) << words;
}

TEST(HandEye, AHandThatDoesNotTurnIsRefused) {
  HandEyeWorldOptions options;
  options.turn_rad = 0.0;
  EXPECT_NE(refusal(options).find("the hand turns by"), std::string::npos);
}

// Of quaternions with w first that are read with x first, no more of these poses would help.
TEST(HandEye, RotationsInAnotherConventionAreNoLackOfTurns) {
  HandEyeWorldOptions options;
  HandEyeWorld world = make_hand_eye_world(options);
  for (FlangeReading& reading : world.input.readings) {
    for (Pose& pose : reading.log.poses) {
      const Eigen::Quaterniond q = pose.rotation;
      pose.rotation = Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y());
    }
  }
  try {
    static_cast<void>(calibrate_hand_eye(world.input, untraced()));
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("order of the quaternion"), std::string::npos)
        << error.what();
  }
}

TEST(HandEye, FivePosesAreTooFew) {
  HandEyeWorldOptions options;
  options.poses = 5;
  EXPECT_NE(refusal(options).find("5 poses"), std::string::npos);
}

TEST(HandEye, TheDeclaredMountNamesTheEquation) {
  HandEyeWorld world = make_hand_eye_world({});
  world.input.mount = CameraMount::kFixed;
  const HandEye result = calibrate_hand_eye(world.input, untraced());
  EXPECT_EQ(result.hypothesis.mount, CameraMount::kFixed);
  EXPECT_EQ(result.hypothesis.direction, PoseDirection::kFlangeBase);
}

// The readings of a world, and behind them those of another convention: poses changed by `change`.
HandEyeInput with_other_convention(HandEyeInput input, void (*change)(Pose&)) {
  FlangeReading other = input.readings.front();
  other.rotation = "another convention";
  other.usual = false;
  for (Pose& pose : other.log.poses) change(pose);
  input.readings.push_back(std::move(other));
  return input;
}

void conjugate(Pose& pose) { pose.rotation = pose.rotation.conjugate(); }

TEST(HandEye, AnotherConventionIsTakenWhereItIsClearlyBetter) {
  const HandEyeWorld world = make_hand_eye_world({});
  HandEyeInput input = with_other_convention(world.input, conjugate);
  const HandEye usual = calibrate_hand_eye(input, untraced());
  EXPECT_EQ(usual.hypothesis.rotation, world.input.readings.front().rotation);
  std::swap(input.readings[0].log, input.readings[1].log);
  const HandEye other = calibrate_hand_eye(input, untraced());
  EXPECT_EQ(other.hypothesis.rotation, "another convention");
  EXPECT_EQ(other.camera.T.matrix4(), usual.camera.T.matrix4());
  EXPECT_GT(other.rivals.front().probability, 0.5);
}

TEST(HandEye, TheUsualConventionStaysWhereAnotherIsAsGood) {
  // A hand that is turned by a constant more: another camera, the same equation.
  const HandEyeWorld world = make_hand_eye_world({});
  const HandEyeInput input = with_other_convention(world.input, [](Pose& pose) {
    pose = pose * Pose{exp_rotation({1e-9, 0.0, 0.0}), Eigen::Vector3d::Zero()};
  });
  const HandEye result = calibrate_hand_eye(input, untraced());
  EXPECT_EQ(result.hypothesis.rotation, world.input.readings.front().rotation);
}

TEST(HandEye, TheOrderOfSightingsDoesNotMatter) {
  HandEyeWorldOptions options;
  options.targets = 3;
  HandEyeWorld world = make_hand_eye_world(options);
  const HandEye one = calibrate_hand_eye(world.input, untraced());
  std::ranges::reverse(world.input.measurements.corners);
  const HandEye other = calibrate_hand_eye(world.input, untraced());
  EXPECT_EQ(one.camera.T.matrix4(), other.camera.T.matrix4());
  EXPECT_EQ(one.covariance, other.covariance);
}

}  // namespace
}  // namespace kinescope
