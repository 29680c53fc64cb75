// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/rigid_bodies.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr int kFrames = 120;

// Sways about where it is, each axis in its own time.
Pose swaying(double size, double seconds, double t_s) {
  Vector6d twist;
  for (Eigen::Index i = 0; i < 6; ++i)
    twist[i] = size * std::sin(2.0 * M_PI * t_s / (seconds + 0.37 * static_cast<double>(i)));
  return exp_pose(twist);
}

// Markers 1, 2 and 3 on one body, 4 on a second that moves against it, before a camera.
PoseTracks two_bodies(double camera_sway, Rng& rng) {
  constexpr double kNoise_rad = 2e-3;
  constexpr double kNoise_m = 1e-3;
  PoseTracks out;
  for (int f = 0; f < kFrames; ++f) out.times_s.push_back(f / 30.0);
  std::vector<Pose> mounts;
  for (int m = 0; m < 4; ++m) mounts.push_back({exp_rotation(rng.normal3(0.3)), rng.normal3(0.1)});
  for (int m = 0; m < 4; ++m) {
    PoseTrack& track = out.tracks.emplace_back(PoseTrack{TagId{m + 1}, {}});
    for (int f = 0; f < kFrames; ++f) {
      const double t_s = out.times_s[static_cast<std::size_t>(f)];
      Pose T_camera_body = swaying(camera_sway, 2.3, t_s);
      T_camera_body.translation.z() += 1.0;
      if (m == 3) T_camera_body = T_camera_body * swaying(0.2, 1.7, t_s);
      PoseSample& sample = track.samples.emplace_back();
      sample.frame = f;
      sample.T_camera_marker = T_camera_body * mounts[static_cast<std::size_t>(m)] *
                               Pose{exp_rotation(rng.normal3(kNoise_rad)), rng.normal3(kNoise_m)};
      sample.covariance.diagonal() << Eigen::Vector3d::Constant(kNoise_rad * kNoise_rad),
          Eigen::Vector3d::Constant(kNoise_m * kNoise_m);
    }
  }
  return out;
}

TEST(RigidBodies, AreMarkersThatKeepTheirPlaces) {
  Rng rng = Rng::from_name("rigid bodies", 1);
  const auto bodies = rigid_bodies(two_bodies(0.1, rng));
  ASSERT_EQ(bodies.size(), 2U);
  EXPECT_EQ(bodies[0], (std::vector<TagId>{TagId{1}, TagId{2}, TagId{3}}));
  EXPECT_EQ(bodies[1], std::vector<TagId>{TagId{4}});
}

TEST(RigidBodies, StandStillBeforeACameraThatDoes) {
  Rng rng = Rng::from_name("rigid bodies", 2);
  EXPECT_TRUE(is_any_at_rest(two_bodies(0.0, rng)));
  EXPECT_FALSE(is_any_at_rest(two_bodies(0.1, rng)));
}

TEST(RigidBodies, NeedMarkersThatAreSeen) {
  EXPECT_TRUE(rigid_bodies({}).empty());
  EXPECT_FALSE(is_any_at_rest({}));
  Rng rng = Rng::from_name("rigid bodies", 3);
  PoseTracks rare = two_bodies(0.1, rng);
  for (PoseTrack& track : rare.tracks) track.samples.resize(3);
  EXPECT_TRUE(rigid_bodies(rare).empty());
}

}  // namespace
}  // namespace kinescope
