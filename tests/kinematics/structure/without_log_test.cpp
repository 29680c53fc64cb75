// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

TEST(WithoutLog, ChainFromTheTracksAlone) {
  const Scene scene = make_scene("NoLogChain", {.joints = 4}, noisy());
  const Structure s = find_structure(scene.recording.tracks, JointLog{});
  EXPECT_EQ(described(s, scene.robot), described(scene, false));
  EXPECT_EQ(s.joint_values.rows(), 600);
  for (Eigen::Index j = 0; j < s.joint_values.cols(); ++j) {
    EXPECT_GT((s.joint_values.col(j).array().isFinite()).count(), 550);
  }
}

TEST(WithoutLog, JointValuesFollowTheTruth) {
  const Scene scene = make_scene("NoLogValues", {.joints = 1, .prismatic_share = 0.0}, noisy());
  const Structure s = find_structure(scene.recording.tracks, JointLog{});
  ASSERT_EQ(s.joints.size(), 1U);
  double sum = 0.0;
  const Eigen::VectorXd truth =
      scene.recording.joint_values.col(0).array() - scene.recording.joint_values.col(0).mean();
  const Eigen::VectorXd found = s.joint_values.col(0).array() - s.joint_values.col(0).mean();
  const double sign = truth.dot(found) > 0.0 ? 1.0 : -1.0;
  for (Eigen::Index f = 0; f < truth.size(); ++f) sum += std::pow(truth(f) - sign * found(f), 2);
  // One pose tells the angle to 0.5 deg, or better with its distance from the axis.
  EXPECT_LT(std::sqrt(sum / static_cast<double>(truth.size())), 0.7 * kDegree);
}

// A body that wanders in all six directions.
PoseTrack wandering(TagId id, const std::vector<double>& times, Rng& rng, bool hinge_at_first) {
  PoseTrack track;
  track.id = id;
  Vector6d amplitude;
  amplitude << 0.4, 0.5, 0.3, 0.1, 0.12, 0.08;
  Vector6d phase;
  phase << rng.normal3(2.0), rng.normal3(2.0);
  for (std::size_t f = 0; f < times.size(); ++f) {
    Vector6d d;
    for (Eigen::Index c = 0; c < 6; ++c) {
      const double hz = 0.08 + 0.03 * static_cast<double>(c);
      d(c) = amplitude(c) * std::sin(2.0 * std::numbers::pi * hz * times[f] + phase(c));
    }
    // A stretch that looks like a hinge.
    if (hinge_at_first && f < times.size() / 4) d = amplitude * std::sin(0.5 * times[f]);
    PoseSample s;
    s.frame = static_cast<int>(f);
    Vector6d noise;
    noise << rng.normal3(0.5 * kDegree), rng.normal3(3e-3);
    s.T_camera_marker = Pose{Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.1, 0.0, 1.5)} *
                        exp_pose(d) * exp_pose(noise);
    s.covariance = Matrix6d::Zero();
    s.covariance.diagonal() << Eigen::Vector3d::Constant(std::pow(0.5 * kDegree, 2)),
        Eigen::Vector3d::Constant(9e-6);
    track.samples.push_back(std::move(s));
  }
  return track;
}

TEST(WithoutLog, FreeBodiesAreNoJoints) {
  for (const bool hinge : {false, true}) {
    for (std::uint64_t salt = 0; salt < 5; ++salt) {
      Scene scene = make_scene("FreeBody", {.joints = 1}, noisy());
      Rng rng = Rng::from_name("FreeBody", salt);
      scene.recording.tracks.tracks.push_back(
          wandering(TagId{50}, scene.recording.tracks.times_s, rng, hinge));
      const Structure s = find_structure(scene.recording.tracks, JointLog{});
      ASSERT_EQ(s.free_markers.size(), 1U) << salt;
      EXPECT_EQ(s.free_markers[0], TagId{50});
      EXPECT_EQ(s.joints.size(), 1U);
      EXPECT_FALSE(s.doubts.empty());
    }
  }
}

// A board moved by hand: while one of its markers is seen it happens to turn about one axis.
TEST(WithoutLog, AMarkerOfTheSameBoardContradictsAJoint) {
  Scene scene = make_scene("Board", {.joints = 1}, noisy());
  Rng rng = Rng::from_name("Board", 1);
  const std::vector<double>& times = scene.recording.tracks.times_s;
  PoseTrack whole = wandering(TagId{50}, times, rng, true);
  PoseTrack part = whole;
  part.id = TagId{51};
  std::erase_if(part.samples,
                [&](const PoseSample& s) { return s.frame >= static_cast<int>(times.size() / 4); });
  for (PoseSample& s : part.samples) {
    Vector6d noise;
    noise << rng.normal3(0.5 * kDegree), rng.normal3(3e-3);
    const Pose beside{Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.06, 0.0, 0.0)};
    s.T_camera_marker = s.T_camera_marker * beside * exp_pose(noise);
  }
  scene.recording.tracks.tracks.push_back(whole);
  scene.recording.tracks.tracks.push_back(part);
  const Structure s = find_structure(scene.recording.tracks, JointLog{});
  EXPECT_EQ(s.free_markers, (std::vector{TagId{50}, TagId{51}}));
  EXPECT_EQ(s.joints.size(), 1U);
}

TEST(WithoutLog, AFreeBodyBesideALoggedRobotIsFree) {
  Scene scene = make_scene("FreeBesideRobot", {.joints = 3}, noisy());
  Rng rng = Rng::from_name("FreeBesideRobot", 1);
  scene.recording.tracks.tracks.push_back(
      wandering(TagId{50}, scene.recording.tracks.times_s, rng, false));
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  ASSERT_EQ(s.free_markers.size(), 1U);
  EXPECT_EQ(s.joints.size(), 3U);
}

TEST(WithoutLog, APassiveJointBesideLoggedOnes) {
  Scene scene = make_scene("Passive", {.joints = 3}, noisy());
  // The log lacks the channel of the last joint.
  const int lost = scene.recording.channel_of_joint[2];
  JointLog log = scene.recording.log;
  log.channels.erase(log.channels.begin() + lost);
  log.values.resize(log.values.rows(), 2);
  Eigen::Index column = 0;
  for (int c = 0; c < 3; ++c) {
    if (c != lost) log.values.col(column++) = scene.recording.log.values.col(c);
  }
  const Structure s = find_structure(scene.recording.tracks, log);
  ASSERT_EQ(s.joints.size(), 3U);
  int passive = 0;
  for (std::size_t j = 0; j < 3; ++j) {
    if (s.joints[j].channel) continue;
    ++passive;
    EXPECT_TRUE(s.joint_values.col(static_cast<Eigen::Index>(j)).array().isFinite().any());
    EXPECT_EQ(s.joints[j].type, scene.robot.tree.joints[2].type);
  }
  EXPECT_EQ(passive, 1);
}

}  // namespace
}  // namespace kinescope
