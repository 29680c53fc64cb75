// SPDX-License-Identifier: Apache-2.0
//
// Errors that are no noise must not break a robot apart: they are what tracing looks for later.
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

constexpr int kRobots = 3;

// Refined corners of tags of 40 px at 1 m or so.
RecordingOptions refined_corners() {
  RecordingOptions o;
  o.frames = 330;
  o.sigma_m = 3e-4;
  o.sigma_rad = 0.1 * kDegree;
  return o;
}

PoseTrack& track_on(Scene& scene, int link) {
  for (PoseTrack& track : scene.recording.tracks.tracks) {
    if (scene.robot.tree.marker(track.id)->link.value == link) return track;
  }
  throw std::logic_error("no marker on the link");
}

void expect_right(const Scene& scene, const std::string& what) {
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(described(s, scene.robot), described(scene)) << what;
  EXPECT_TRUE(s.free_markers.empty()) << what;
}

class SystematicErrors : public testing::TestWithParam<int> {
 protected:
  [[nodiscard]] static Scene scene() {
    return make_scene("Systematic " + std::to_string(GetParam()), {.joints = 3 + GetParam()},
                      refined_corners());
  }
};

TEST_P(SystematicErrors, AMarkerOfAnotherSize) {
  for (const double factor : {1.01, 0.97}) {
    Scene s = scene();
    for (PoseSample& sample : track_on(s, 1).samples) sample.T_camera_marker.translation *= factor;
    expect_right(s, "size");
  }
}

TEST_P(SystematicErrors, AMarkerThatSlips) {
  Scene s = scene();
  const Pose slip{exp_rotation({0.0, 0.0, 0.03}), {0.004, -0.002, 0.0}};
  for (PoseSample& sample : track_on(s, 2).samples) {
    if (sample.frame > 180) sample.T_camera_marker = sample.T_camera_marker * slip;
  }
  expect_right(s, "slip");
}

TEST_P(SystematicErrors, ACameraThatIsBumped) {
  Scene s = scene();
  const Pose bump{exp_rotation({0.003, -0.002, 0.001}), {0.001, 0.002, 0.0}};
  for (PoseTrack& track : s.recording.tracks.tracks) {
    for (PoseSample& sample : track.samples) {
      if (sample.frame > 150) sample.T_camera_marker = bump * sample.T_camera_marker;
    }
  }
  expect_right(s, "bump");
}

// A link that rocks while its joint moves, as one does that a second joint carries without a
// channel or a marker of its own.
Structure rocking(int robot, double rad) {
  Scene s = make_scene("Rocking " + std::to_string(robot), {.joints = 3, .prismatic_share = 0.0},
                       refined_corners());
  PoseTrack& tip = track_on(s, 3);
  for (PoseSample& sample : tip.samples) {
    const double phase = 0.11 * sample.frame;
    const Pose rock{exp_rotation({rad * std::sin(phase), rad * std::sin(1.7 * phase), 0.0}),
                    {0.3 * rad * std::sin(phase), 0.0, 0.3 * rad * std::sin(1.7 * phase)}};
    sample.T_camera_marker = sample.T_camera_marker * rock;
  }
  return find_structure(s.recording.tracks, s.recording.log);
}

TEST(Misfit, ASmallShareOfTheMotionLeavesTheStructureSure) {
  for (const int robot : {0, 1, 3, 4}) {
    const Structure s = rocking(robot, 0.01);
    EXPECT_EQ(s.status, StructureStatus::kDetermined);
    EXPECT_GT(s.probability, 0.99) << "20 times the noise, but little of the motion";
  }
}

TEST(Misfit, ALargeShareIsInTheProbabilityAndNamed) {
  for (const int robot : {0, 1, 3, 4}) {
    const Structure noticed = rocking(robot, 0.03);
    EXPECT_EQ(noticed.status, StructureStatus::kDetermined);
    EXPECT_LT(noticed.probability, 0.99);
    const Structure gross = rocking(robot, 0.1);
    EXPECT_EQ(gross.status, StructureStatus::kAmbiguous);
    EXPECT_LT(gross.probability, 0.95);
    ASSERT_FALSE(gross.doubts.empty());
    EXPECT_NE(gross.doubts.front().what.find("unexplained"), std::string::npos)
        << gross.doubts.front().what;
  }
}

INSTANTIATE_TEST_SUITE_P(Robots, SystematicErrors, testing::Range(0, kRobots));

}  // namespace
}  // namespace kinescope
