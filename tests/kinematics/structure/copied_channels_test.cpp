// SPDX-License-Identifier: Apache-2.0
//
// Logs with commands beside measured values: two names of one channel.
#include "kinematics/structure/copied_channels.h"

#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

// The log with a second column for every channel, before or after the measured ones: `lead_s` ahead
// and `noise` (rms, in the channel's unit) away.
JointLog with_commands(const JointLog& log, double lead_s, double noise, bool before) {
  Rng rng = Rng::from_name("Commands");
  JointLog out = log;
  const Eigen::Index n = log.values.cols();
  out.values.resize(log.values.rows(), 2 * n);
  out.channels.resize(static_cast<std::size_t>(2 * n));
  const Eigen::Index measured = before ? n : 0;
  const Eigen::Index command = before ? 0 : n;
  for (Eigen::Index c = 0; c < n; ++c) {
    const std::string& name = log.channels[static_cast<std::size_t>(c)];
    out.channels[static_cast<std::size_t>(measured + c)] = name;
    out.channels[static_cast<std::size_t>(command + c)] = "goal_" + name;
    for (Eigen::Index i = 0; i < log.values.rows(); ++i) {
      const double t = log.times_s[static_cast<std::size_t>(i)] + lead_s;
      const auto ahead = interpolate(log, static_cast<int>(c), t);
      out.values(i, measured + c) = log.values(i, c);
      out.values(i, command + c) = (ahead ? ahead->value : log.values(i, c)) + rng.normal(noise);
    }
  }
  return out;
}

bool is_goal(const JointLog& log, int channel) {
  return log.channels[static_cast<std::size_t>(channel)].starts_with("goal_");
}

void expect_one_of_each(const Structure& s, const JointLog& log, bool goals) {
  EXPECT_EQ(s.status, StructureStatus::kDetermined) << s.runner_up;
  EXPECT_GT(s.probability, 0.99);
  ASSERT_EQ(s.joints.size(), 4U);
  for (const StructureJoint& joint : s.joints) {
    ASSERT_TRUE(joint.channel);
    EXPECT_EQ(is_goal(log, joint.channel->channel), goals);
  }
  EXPECT_TRUE(s.idle_channels.empty());
  ASSERT_EQ(s.copied_channels.size(), 4U);
  for (const ChannelCopy& copy : s.copied_channels) {
    EXPECT_NE(is_goal(log, copy.channel), is_goal(log, copy.of));
    EXPECT_EQ(is_goal(log, copy.of), goals);
  }
  EXPECT_TRUE(std::ranges::any_of(s.doubts, [&](const StructureDoubt& d) {
    return d.what.find("repeat") != std::string::npos && d.names.size() == 4;
  }));
}

TEST(CopiedChannels, CommandsBesideMeasuredValuesAreOneChannelEach) {
  const Scene scene = make_scene("Goals", {.joints = 4}, noisy());
  for (const double lead_s : {0.0, 0.002, 0.02}) {
    const JointLog log = with_commands(scene.recording.log, lead_s, 2e-4, false);
    const Structure s = find_structure(scene.recording.tracks, log);
    expect_one_of_each(s, log, false);
    EXPECT_EQ(described(s, scene.robot), described(scene));
  }
}

// A servo stays behind its command by what it carries: too far for the same quantity, and yet no
// channel that drives nothing.
TEST(CopiedChannels, CommandsThatAreFollowedLooselyDriveNothingElse) {
  constexpr double kDroop = 2.5 * kDegree;
  const Scene scene = make_scene("Goals", {.joints = 4, .prismatic_share = 0.0}, noisy());
  JointLog log = with_commands(scene.recording.log, 0.05, 0.0, false);
  for (Eigen::Index c = 0; c < 4; ++c)
    log.values.col(4 + c).array() += kDroop * log.values.col((c + 1) % 4).array().cos();
  EXPECT_LT(structure_search::same_quantities(log).size(), 4U);
  const Structure s = find_structure(scene.recording.tracks, log);
  expect_one_of_each(s, log, false);
  EXPECT_EQ(described(s, scene.robot), described(scene));
}

// Neither does a channel that moves otherwise repeat one.
TEST(CopiedChannels, AChannelThatMovesByItselfRepeatsNone) {
  const Scene scene = make_scene("Goals", {.joints = 3}, noisy());
  EXPECT_TRUE(structure_search::repeated_loosely(scene.recording.log, {0}, {1, 2}).empty());
}

// The measured one where they fit alike (the first where names do not tell), the better one where
// not.
TEST(CopiedChannels, TheColumnThatTheMarkersFollowIsUsed) {
  RecordingOptions o;
  o.sigma_m = 3e-5;
  o.sigma_rad = 0.01 * kDegree;
  const Scene scene = make_scene("Goals", {.joints = 4, .prismatic_share = 0.0}, o);
  const JointLog alike = with_commands(scene.recording.log, 0.0, 1e-6, true);
  expect_one_of_each(find_structure(scene.recording.tracks, alike), alike, false);
  JointLog unnamed = alike;
  for (std::size_t c = 0; c < 4; ++c) unnamed.channels[c] = "other" + std::to_string(c);
  for (const StructureJoint& joint : find_structure(scene.recording.tracks, unnamed).joints) {
    ASSERT_TRUE(joint.channel);
    EXPECT_LT(joint.channel->channel, 4);
  }
  const JointLog worse = with_commands(scene.recording.log, 0.0, 3e-3, true);
  expect_one_of_each(find_structure(scene.recording.tracks, worse), worse, false);
}

TEST(CopiedChannels, JointsThatMoveAlikeKeepTheirChannels) {
  RecordingOptions o = noisy();
  o.together = {{0, 2}};
  const Scene scene = make_scene("Together", {.joints = 4, .prismatic_share = 0.0}, o);
  const JointLog& log = scene.recording.log;
  EXPECT_EQ(structure_search::same_quantities(log).size(), 1U);
  const Structure s = find_structure(scene.recording.tracks, log);
  EXPECT_EQ(s.status, StructureStatus::kUndetermined);
  EXPECT_EQ(s.joints.size(), 4U);
  EXPECT_TRUE(s.copied_channels.empty());
}

TEST(CopiedChannels, OtherUnitsAndOtherMotionsAreNoCopies) {
  Scene scene = make_scene("Goals", {.joints = 3}, noisy());
  JointLog log = with_commands(scene.recording.log, 0.0, 0.0, false);
  log.values.rightCols(3) *= 57.3;
  EXPECT_TRUE(structure_search::same_quantities(log).empty());
}

}  // namespace
}  // namespace kinescope
