// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/tracks_from_base.h"

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr double kRounding = 1e-12;
constexpr int kFramesSeen = 60;

struct Scene {
  PoseTracks tracks;
  std::vector<Pose> path;           // T_camera_base
  std::vector<Pose> T_base_marker;  // of 0, 1, 2 at rest
  std::vector<Pose> moving;         // of 9, in the base, by frame
};

// The first two of the base are never seen with one another, the third with both.
Scene scene(double sigma, Rng& rng) {
  Scene out;
  for (int m = 0; m < 3; ++m)
    out.T_base_marker.push_back(m == 0 ? Pose{}
                                       : Pose{exp_rotation(rng.normal3(0.5)), rng.normal3(0.2)});
  for (const int id : {0, 1, 2, 9}) out.tracks.tracks.push_back({TagId{id}, {}});
  for (int f = 0; f < kFramesSeen; ++f) {
    out.tracks.times_s.push_back(0.1 * f);
    Pose camera{exp_rotation(rng.normal3(0.3)), rng.normal3(0.1)};
    camera.translation.z() += 1.0;
    out.path.push_back(camera);
    out.moving.push_back({exp_rotation(rng.normal3(0.3)), rng.normal3(0.1)});
    const auto see = [&](std::size_t track, const Pose& T_base) {
      PoseSample sample;
      sample.frame = f;
      Vector6d noise;
      noise << rng.normal3(sigma), rng.normal3(sigma);
      sample.T_camera_marker = camera * T_base * exp_pose(noise);
      sample.covariance = Matrix6d::Identity() * std::max(sigma * sigma, 1e-18);
      out.tracks.tracks[track].samples.push_back(sample);
    };
    see(f % 2 == 0 ? 0 : 1, out.T_base_marker[f % 2 == 0 ? 0 : 1]);
    see(2, out.T_base_marker[2]);
    see(3, out.moving.back());
  }
  return out;
}

const std::vector<TagId> kBase{TagId{0}, TagId{1}, TagId{2}};

TEST(TracksFromBase, AreExactWithoutNoise) {
  Rng rng = Rng::from_name("tracks from base", 1);
  const Scene truth = scene(0.0, rng);
  const BaseView view = tracks_from_base(truth.tracks, kBase);
  ASSERT_EQ(view.markers, kBase);
  for (std::size_t m = 0; m < kBase.size(); ++m)
    EXPECT_LT(log_pose(truth.T_base_marker[m].inverse() * view.T_base_marker[m]).norm(), kRounding);
  ASSERT_EQ(view.others.tracks.size(), 1U);
  ASSERT_EQ(view.others.tracks[0].samples.size(), static_cast<std::size_t>(kFramesSeen));
  for (std::size_t f = 0; f < truth.path.size(); ++f) {
    EXPECT_LT(log_pose(truth.path[f].inverse() * view.cameras[f]->T_camera_base).norm(), kRounding);
    const Pose& seen = view.others.tracks[0].samples[f].T_camera_marker;
    EXPECT_LT(log_pose(truth.moving[f].inverse() * seen).norm(), kRounding);
  }
}

// Errors over their covariances, six degrees of freedom each.
TEST(TracksFromBase, ClaimTheirScatter) {
  double camera = 0.0, marker = 0.0;
  int count = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    Rng rng = Rng::from_name("tracks from base, scatter", seed);
    const Scene truth = scene(1e-3, rng);
    const BaseView view = tracks_from_base(truth.tracks, kBase);
    for (std::size_t f = 0; f < truth.path.size(); ++f) {
      const Vector6d d = log_pose(truth.path[f].inverse() * view.cameras[f]->T_camera_base);
      camera += d.dot(view.cameras[f]->covariance.inverse() * d);
      const PoseSample& sample = view.others.tracks[0].samples[f];
      const Vector6d e = log_pose(truth.moving[f].inverse() * sample.T_camera_marker);
      marker += e.dot(sample.covariance.inverse() * e);
      ++count;
    }
  }
  // The map's own error, of thirty frames, is not in the covariances: a few per cent.
  EXPECT_NEAR(camera / (6.0 * count), 1.0, 0.15);
  EXPECT_NEAR(marker / (6.0 * count), 1.0, 0.15);
}

TEST(TracksFromBase, LeaveOutWhatNothingTies) {
  Rng rng = Rng::from_name("tracks from base", 2);
  Scene truth = scene(0.0, rng);
  std::erase_if(truth.tracks.tracks, [](const PoseTrack& track) { return track.id == TagId{2}; });
  const BaseView view = tracks_from_base(truth.tracks, kBase);
  EXPECT_EQ(view.markers, std::vector<TagId>{TagId{0}});
  EXPECT_FALSE(view.cameras[1].has_value());
  EXPECT_EQ(view.others.tracks[0].samples.size(), static_cast<std::size_t>(kFramesSeen) / 2);
}

}  // namespace
}  // namespace kinescope
