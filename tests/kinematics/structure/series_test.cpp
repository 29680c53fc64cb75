// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/series.h"

#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope::structure_search {
namespace {

// Angle beyond which a sighting is on the wrong branch.
constexpr double kWrong = 0.1;

int wrong_sightings(const Series& series, const Scene& scene) {
  int wrong = 0;
  for (const Body& body : series.bodies) {
    const Marker& marker = *scene.robot.tree.marker(body.id);
    for (std::size_t i = 0; i < body.at.size(); ++i) {
      if (!body.at[i].seen) continue;
      const auto poses = forward_kinematics(
          scene.robot.tree, scene.recording.joint_values.row(series.frames[i]).transpose());
      const Pose truth =
          scene.robot.T_camera_base * poses[marker.link.index()] * marker.T_link_marker;
      wrong += angle_between(truth.rotation, body.at[i].pose.rotation) > kWrong ? 1 : 0;
    }
  }
  return wrong;
}

TEST(Series, FlipsAreSwappedOrDropped) {
  RecordingOptions o = noisy();
  o.flip_share = 0.1;
  o.alternatives = true;
  const Scene scene = make_scene("FlipsAreSwapped", {.joints = 3}, o);
  const Series series = clean_series(scene.recording.tracks);
  EXPECT_TRUE(series.smooth);
  int seen = 0;
  for (const Body& b : series.bodies) seen += b.seen;
  // 4 markers, 600 frames: nearly all are kept, on the right branch.
  EXPECT_GT(seen, 2300);
  EXPECT_LE(wrong_sightings(series, scene), 12);
}

TEST(Series, FlipsWithoutTheOtherBranchAreDropped) {
  RecordingOptions o = noisy();
  o.flip_share = 0.1;
  const Scene scene = make_scene("FlipsAreDropped", {.joints = 3}, o);
  const Series series = clean_series(scene.recording.tracks);
  EXPECT_LE(wrong_sightings(series, scene), 12);
}

TEST(Series, NoiseIsMeasuredNotBelieved) {
  for (const double declared : {0.5, 1.0, 3.0}) {
    RecordingOptions o = noisy();
    o.declared_noise = declared;
    const Scene scene = make_scene("NoiseIsMeasured", {.joints = 2}, o);
    for (const Body& body : clean_series(scene.recording.tracks).bodies) {
      // About 500 windows of six components that overlap: 4 % of spread.
      EXPECT_NEAR(body.noise_scale * declared, 1.0, 0.15);
    }
  }
}

TEST(Series, ThinnedInstantsKeepTheirTimeAndAverageTheNoise) {
  const Scene scene = make_scene("Thinned", {.joints = 1}, noisy());
  const Series full = clean_series(scene.recording.tracks);
  const Series thin = thinned(full, 200);
  EXPECT_EQ(thin.size(), 200);
  EXPECT_EQ(thin.half_width, 1);
  for (int i = 0; i < thin.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    EXPECT_DOUBLE_EQ(thin.times_s[k], full.times_s[static_cast<std::size_t>(thin.frames[k])]);
  }
  const Sighting& averaged = thin.bodies.front().at[50];
  const Sighting& one = full.bodies.front().at[static_cast<std::size_t>(thin.frames[50])];
  EXPECT_NEAR(averaged.covariance(0, 0) * 3.0, one.covariance(0, 0), 1e-12);
}

TEST(Series, PosturesAtRestAreNotSmooth) {
  RecordingOptions o = noisy();
  o.rate_hz = 0.1;
  o.frames = 60;
  const Scene scene = make_scene("Postures", {.joints = 3, .base_marker = false}, o);
  const Series series = clean_series(scene.recording.tracks);
  EXPECT_FALSE(series.smooth);
  for (const Body& b : series.bodies) EXPECT_EQ(b.seen, 60);
}

TEST(Series, NumbersThatAreNoneAreLeftOut) {
  Scene scene = make_scene("NaN", {.joints = 1}, noisy());
  PoseSample& s = scene.recording.tracks.tracks.front().samples[7];
  s.T_camera_marker.translation.x() = std::nan("");
  scene.recording.tracks.tracks.front().samples[9].covariance(2, 2) = std::nan("");
  const Series series = clean_series(scene.recording.tracks);
  EXPECT_FALSE(series.bodies.front().at[7].seen);
  EXPECT_FALSE(series.bodies.front().at[9].seen);
}

}  // namespace
}  // namespace kinescope::structure_search
