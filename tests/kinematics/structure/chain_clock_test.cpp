// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/chain_clock.h"

#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

// The last marker of a chain alone, and the log that much ahead of the frames.
std::optional<double> offset_of(int joints, double ahead_s, std::uint64_t seed) {
  RandomRobotOptions robot;
  robot.joints = joints;
  robot.prismatic_share = 0.0;
  RecordingOptions recording;
  recording.frames = 600;
  Rng rng = Rng::from_name("chain clock", seed);
  const RandomRobot chain = random_robot(robot, rng);
  const auto recorded = record(chain, recording, rng);
  JointLog log = recorded.log;
  for (double& t : log.times_s) t += ahead_s;
  const TagId last = chain.tree.markers.back().id;
  const auto track = std::ranges::find(recorded.tracks.tracks, last, &PoseTrack::id);
  return chain_clock_offset(*track, recorded.tracks.times_s, log, 1.0, 0.5);
}

// Of some motions no offset stands out; what is said is right.
TEST(ChainClock, ShowsTheOffsetOfThreeJointsInSeries) {
  // What the model lacks of joints that turn by a radian: 20 ms at most of these.
  constexpr double kClose_s = 0.025;
  constexpr int kRobots = 8;
  for (const double ahead_s : {-0.4, 0.0, 0.137}) {
    int shown = 0;
    for (std::uint64_t seed = 1; seed <= kRobots; ++seed) {
      const auto offset_s = offset_of(3, ahead_s, seed);
      if (!offset_s) continue;
      ++shown;
      EXPECT_NEAR(*offset_s, ahead_s, kClose_s) << seed;
    }
    EXPECT_GE(shown, kRobots - 2);
  }
}

TEST(ChainClock, SaysNothingOfALogThatStandsStill) {
  RandomRobotOptions robot;
  robot.joints = 3;
  Rng rng = Rng::from_name("chain clock", 9);
  const RandomRobot chain = random_robot(robot, rng);
  auto recorded = record(chain, {}, rng);
  recorded.log.values.setZero();
  EXPECT_FALSE(chain_clock_offset(recorded.tracks.tracks.back(), recorded.tracks.times_s,
                                  recorded.log, 1.0, 0.5)
                   .has_value());
  EXPECT_FALSE(chain_clock_offset({}, {}, recorded.log, 1.0, 0.5).has_value());
}

}  // namespace
}  // namespace kinescope
