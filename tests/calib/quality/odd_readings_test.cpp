// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/odd_readings.h"

#include <cmath>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr double kStep_s = 0.1;
constexpr double kOffset_s = 0.25;

// Of a film whose clock is behind the log's.
Calibration film() {
  Calibration out;
  for (int frame = 0; frame < 100; ++frame) out.times_s.push_back(kStep_s * frame);
  out.time_offset_s = kOffset_s;
  return out;
}

OddReading odd(int frame, const std::string& channel, double read, double expected) {
  return {kStep_s * frame, channel, read, expected};
}

TEST(OddStretches, AFrozenReadingIsOneWithAFrameBetween) {
  // In frame 22 the joint comes by what it reads.
  const std::vector<OddStretch> found =
      odd_stretches(film(), {},
                    {odd(20, "q1", 0.5, 0.3), odd(21, "q1", 0.5, 0.4), odd(23, "q1", 0.5, 0.9),
                     odd(24, "q1", 0.5, 0.8)});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].channels.front(), "q1");
  EXPECT_EQ(found[0].frames, 4);
  EXPECT_TRUE(found[0].stands_still);
  EXPECT_DOUBLE_EQ(found[0].from_s, 20 * kStep_s + kOffset_s);
  EXPECT_DOUBLE_EQ(found[0].to_s, 24 * kStep_s + kOffset_s);
  EXPECT_EQ(found[0].most.expected, 0.9);
}

TEST(OddStretches, ChannelsThatAreWrongTogetherAreOneAndASingleFrameIsNone) {
  const std::vector<OddStretch> found =
      odd_stretches(film(), {},
                    {odd(5, "q2", 0.1, 0.2), odd(30, "q2", 0.1, 0.2), odd(31, "q1", 1.0, 2.0),
                     odd(31, "q2", 0.15, 0.2), odd(32, "q1", 1.0, 2.0), odd(60, "q1", 1.0, 0.0),
                     odd(61, "q1", 1.1, 0.0)});
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].channels, (std::vector<std::string>{"q2", "q1"}));
  EXPECT_FALSE(found[0].stands_still);
  EXPECT_DOUBLE_EQ(found[0].from_s, 30 * kStep_s + kOffset_s);
  EXPECT_DOUBLE_EQ(found[0].to_s, 32 * kStep_s + kOffset_s);
  EXPECT_EQ(found[1].channels, std::vector<std::string>{"q1"});
  EXPECT_DOUBLE_EQ(found[1].from_s, 60 * kStep_s + kOffset_s);
  EXPECT_FALSE(found[1].stands_still);
  EXPECT_EQ(found[1].most.read, 1.1);
  EXPECT_TRUE(odd_stretches(film(), {}, {}).empty());
}

// Two joints that move, a marker on the base and one behind each; filmed at 10 Hz, logged at 100
// Hz.
struct Filmed {
  Calibration calibration;
  PoseTracks tracks;
  JointLog log;
};

Eigen::Vector2d values_at(double t) {
  return {0.6 * std::sin(1.1 * t), 0.4 * std::cos(1.7 * t) + 0.3};
}

Filmed filmed() {
  constexpr int kFrames = 200;
  Filmed out;
  KinematicTree& tree = out.calibration.tree;
  tree.links = {{"base"}, {"upper"}, {"lower"}};
  for (int j = 0; j < 2; ++j) {
    Joint& joint = tree.joints.emplace_back();
    joint.type = JointType::kRevolute;
    joint.parent = LinkId{j};
    joint.child = LinkId{j + 1};
    joint.channel = j == 0 ? "q1" : "q2";
    joint.T_parent_joint = {exp_rotation({0.9 * j, 0.1, 0.2}), {0.3, 0.05, 0.1}};
  }
  for (int l = 0; l < 3; ++l)
    tree.markers.push_back(
        {TagId{l}, LinkId{l}, {exp_rotation({0.2, 0.1, 0.5 * l}), {0.1, 0.0, 0.05}}});
  out.calibration.T_camera_base = {exp_rotation({2.0, 0.1, 0.0}), {0.1, 0.2, 1.5}};
  out.calibration.joint_values.resize(kFrames, 2);
  out.tracks.tracks = {{TagId{0}, {}}, {TagId{1}, {}}, {TagId{2}, {}}};
  for (int f = 0; f < kFrames; ++f) {
    out.calibration.times_s.push_back(kStep_s * f);
    const std::vector<Pose> links = forward_kinematics(tree, values_at(kStep_s * f));
    for (const Marker& marker : tree.markers) {
      PoseSample sample;
      sample.frame = f;
      sample.T_camera_marker =
          out.calibration.T_camera_base * links[marker.link.index()] * marker.T_link_marker;
      out.tracks.tracks[static_cast<std::size_t>(marker.id.value)].samples.push_back(sample);
    }
  }
  out.tracks.times_s = out.calibration.times_s;
  out.log.channels = {"q1", "q2"};
  out.log.values.resize(10 * kFrames, 2);
  for (int i = 0; i < 10 * kFrames; ++i) {
    out.log.times_s.push_back(0.1 * kStep_s * i);
    out.log.values.row(i) = values_at(out.log.times_s.back());
  }
  return out;
}

// A fit lost what the log has elsewhere by more than a degree.
std::vector<OddStretch> stretches_of(Filmed& film) {
  Calibration& calibration = film.calibration;
  calibration.joint_values = resample(film.log, calibration.times_s);
  for (int f = 0; f < std::ssize(calibration.times_s); ++f) {
    const Eigen::Vector2d off =
        calibration.joint_values.row(f).transpose() - values_at(kStep_s * f);
    for (int id = 0; id < 3; ++id) {
      SightingResidual& residual = calibration.residuals.emplace_back();
      residual.frame = f;
      residual.id = TagId{id};
      residual.used = off.head(id).cwiseAbs().sum() < 0.02;
    }
  }
  return odd_stretches(calibration, film.log, odd_readings(calibration, film.tracks, film.log));
}

TEST(OddStretches, OfAMotionThatTheMarkersAndTheLogShowThereAreNone) {
  Filmed film = filmed();
  EXPECT_TRUE(stretches_of(film).empty());
}

TEST(OddStretches, AColumnThatFrozeIsOneFromItsFirstRowToItsLast) {
  Filmed film = filmed();
  for (int i = 501; i <= 560; ++i) film.log.values(i, 1) = film.log.values(500, 1);
  const std::vector<OddStretch> found = stretches_of(film);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].channels, std::vector<std::string>{"q2"});
  EXPECT_TRUE(found[0].stands_still);
  EXPECT_NEAR(found[0].from_s, 5.01, 1e-9);
  EXPECT_NEAR(found[0].to_s, 5.6, 1e-9);
  EXPECT_NEAR(found[0].most.expected, values_at(found[0].most.time_s)[1], 1e-6);
}

TEST(OddStretches, RowsThatWereWrittenTwiceAreNamedWithAllTheirChannels) {
  Filmed film = filmed();
  for (int i = 700; i < 800; ++i) film.log.values.row(i) = film.log.values.row(i - 100);
  const std::vector<OddStretch> found = stretches_of(film);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].channels, (std::vector<std::string>{"q1", "q2"}));
  EXPECT_FALSE(found[0].stands_still);
  ASSERT_TRUE(found[0].repeats_s);
  EXPECT_NEAR(*found[0].repeats_s, 1.0, 1e-9);
  EXPECT_NEAR(found[0].from_s, 7.0, 1e-9);
  EXPECT_NEAR(found[0].to_s, 7.99, 1e-9);
  const std::vector<std::string> lines = lines_of(found, film.log);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NE(lines[0].find("'q1', 'q2' are wrong (the rows of 1 s before, once more)"),
            std::string::npos)
      << lines[0];
}

TEST(OddStretches, ReadingsThatCameLateAreOneHoweverSlowTheJointsAreBetween) {
  Filmed film = filmed();
  for (int i = 300; i < 600; ++i)
    film.log.values.row(i) = values_at(film.log.times_s[static_cast<std::size_t>(i)] - 0.25);
  const std::vector<OddStretch> found = stretches_of(film);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].channels, (std::vector<std::string>{"q1", "q2"}));
  ASSERT_TRUE(found[0].late_s);
  EXPECT_NEAR(*found[0].late_s, 0.25, 0.011);
  EXPECT_NEAR(found[0].from_s, 3.0, 0.3);
  EXPECT_NEAR(found[0].to_s, 6.0, 0.3);
}

// A frame in which only the base's marker is seen, and is an outlier, says nothing of any reading.
TEST(OddStretches, NoneWhereNoMarkerIsBehindAJoint) {
  Filmed film = filmed();
  for (const std::size_t id : {std::size_t{1}, std::size_t{2}})
    film.tracks.tracks[id].samples.clear();
  film.calibration.joint_values = resample(film.log, film.calibration.times_s);
  SightingResidual& residual = film.calibration.residuals.emplace_back();
  residual.frame = 7;
  residual.id = TagId{0};
  residual.used = false;
  EXPECT_TRUE(odd_readings(film.calibration, film.tracks, film.log).empty());
}

// One marker that slipped is no reading: none of the joints brings it back.
TEST(OddStretches, AMarkerThatIsElsewhereIsNone) {
  Filmed film = filmed();
  for (PoseSample& sample : film.tracks.tracks[2].samples)
    if (sample.frame > 100)
      sample.T_camera_marker =
          sample.T_camera_marker * Pose{exp_rotation({0.3, 0.2, 0.0}), {0.0, 0.02, 0.05}};
  Calibration& calibration = film.calibration;
  calibration.joint_values = resample(film.log, calibration.times_s);
  for (int f = 0; f < std::ssize(calibration.times_s); ++f) {
    for (int id = 0; id < 3; ++id) {
      SightingResidual& residual = calibration.residuals.emplace_back();
      residual.frame = f;
      residual.id = TagId{id};
      residual.used = id < 2 || f <= 100;
    }
  }
  EXPECT_TRUE(odd_readings(calibration, film.tracks, film.log).empty());
}

}  // namespace
}  // namespace kinescope
