// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/shown_sizes.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr int kFramesOfArm = 200;
constexpr double kPositionNoise = 1e-3, kDepthNoise = 5e-3;  // m

// Three links in a row that turn about axes of their own, marker 0 on the base, 1 to 3 on the
// links, 4 beside 3; every position divided by what the size is of the declared one.
PoseTracks arm_of(const std::vector<double>& factors) {
  Rng rng = Rng::from_name("shown sizes", 1);
  std::vector<Pose> links, mounts;
  for (int k = 0; k < 4; ++k) links.push_back({exp_rotation(rng.normal3(0.8)), rng.normal3(0.3)});
  for (int k = 0; k < 5; ++k) mounts.push_back({exp_rotation(rng.normal3(0.5)), rng.normal3(0.1)});
  links[0] = {exp_rotation({2.0, 0.3, 0.1}), {0.1, 0.0, 2.0}};
  PoseTracks out;
  for (int id = 0; id < 5; ++id) out.tracks.push_back({TagId{id}, {}});
  for (int f = 0; f < kFramesOfArm; ++f) {
    const double t = 0.05 * f;
    out.times_s.push_back(t);
    Pose link = links[0];
    for (std::size_t k = 0; k < mounts.size(); ++k) {
      if (k > 0 && k < links.size()) {
        const double angle = std::sin((0.7 + 0.4 * static_cast<double>(k)) * t);
        link = link * links[k] * Pose{exp_rotation({0.0, 0.0, angle}), Eigen::Vector3d::Zero()};
      }
      PoseSample& sample = out.tracks[k].samples.emplace_back();
      sample.frame = f;
      Pose seen = link * mounts[k];
      seen.translation +=
          rng.normal3(kPositionNoise) + rng.normal(kDepthNoise) * seen.translation.normalized();
      seen.translation /= factors[k];
      sample.T_camera_marker = seen;
      const Eigen::Matrix3d R = seen.matrix3();
      const Eigen::Vector3d ray = seen.translation.normalized();
      Eigen::Matrix3d of_position = Eigen::Matrix3d::Identity() * kPositionNoise * kPositionNoise;
      of_position += kDepthNoise * kDepthNoise * ray * ray.transpose();
      sample.covariance = Matrix6d::Identity() * kPositionNoise * kPositionNoise;
      sample.covariance.bottomRightCorner<3, 3>() = R.transpose() * of_position * R;
    }
  }
  return out;
}

TEST(ShownSizes, NothingIsSaidOfMarkersThatAreAsDeclared) {
  EXPECT_TRUE(shown_sizes(arm_of({1.0, 1.0, 1.0, 1.0, 1.0})).empty());
  EXPECT_TRUE(shown_sizes({}).empty());
}

TEST(ShownSizes, AMarkerOnAnyLinkThatMovesIsFound) {
  constexpr double kError = 0.02;
  for (const double factor : {0.5, 1.4, 2.2}) {
    for (std::size_t k = 1; k < 5; ++k) {
      std::vector<double> factors(5, 1.0);
      factors[k] = factor;
      const std::vector<ShownSize> shown = shown_sizes(arm_of(factors));
      ASSERT_EQ(shown.size(), 1u) << k;
      EXPECT_EQ(shown[0].id.value, static_cast<int>(k));
      EXPECT_NEAR(shown[0].factor / factor, 1.0, kError);
    }
  }
}

// Its distance from the camera takes the size of one that rests.
TEST(ShownSizes, OfTheBaseNothingIsTold) {
  EXPECT_TRUE(shown_sizes(arm_of({1.7, 1.0, 1.0, 1.0, 1.0})).empty());
}

TEST(ShownSizes, TheSizeOfMostIsBelieved) {
  const std::vector<ShownSize> shown = shown_sizes(arm_of({1.0, 1.6, 1.0, 1.6, 1.6}));
  ASSERT_EQ(shown.size(), 1u);
  EXPECT_EQ(shown[0].id.value, 2);
  EXPECT_NEAR(shown[0].factor, 1.0 / 1.6, 0.02);
}

}  // namespace
}  // namespace kinescope
