// SPDX-License-Identifier: Apache-2.0
//
// The generator itself: no two draws alike, the noise it says, the truth it says.
#include <cmath>

#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

TEST(RandomRobot, SameSeedSameRecordingAnotherSeedAnother) {
  const Scene a = make_scene("Seed", {}, noisy());
  const Scene b = make_scene("Seed", {}, noisy());
  const Scene c = make_scene("Seed 2", {}, noisy());
  EXPECT_EQ(a.recording.log.values, b.recording.log.values);
  EXPECT_EQ(a.recording.tracks.tracks[2].samples[5].T_camera_marker.translation,
            b.recording.tracks.tracks[2].samples[5].T_camera_marker.translation);
  EXPECT_NE(a.recording.log.values, c.recording.log.values);
}

TEST(RandomRobot, NoiseHasTheSigmaItSays) {
  const Scene scene = make_scene("Noise", {.joints = 3}, noisy());
  double rotation = 0.0;
  double translation = 0.0;
  int count = 0;
  for (const PoseTrack& track : scene.recording.tracks.tracks) {
    const Marker& m = *scene.robot.tree.marker(track.id);
    for (const PoseSample& s : track.samples) {
      const auto poses = forward_kinematics(scene.robot.tree,
                                            scene.recording.joint_values.row(s.frame).transpose());
      const Pose truth = scene.robot.T_camera_base * poses[m.link.index()] * m.T_link_marker;
      const Vector6d d = log_pose(truth.inverse() * s.T_camera_marker);
      rotation += d.head<3>().squaredNorm();
      translation += d.tail<3>().squaredNorm();
      count += 3;
    }
  }
  // 7200 components: 0.8 % of spread.
  EXPECT_NEAR(std::sqrt(rotation / count) / (0.5 * kDegree), 1.0, 0.04);
  EXPECT_NEAR(std::sqrt(translation / count) / 3e-3, 1.0, 0.04);
}

TEST(RandomRobot, ReadingsGiveTheJointValues) {
  RecordingOptions o = noisy();
  o.lag_s = 0.2;
  o.channel_scale = 50.0;
  o.random_signs = true;
  const Scene scene = make_scene("Readings", {.joints = 4}, o);
  const Eigen::MatrixXd readings =
      resample(scene.recording.log, scene.recording.tracks.times_s, 0.2);
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::VectorXd value =
        scene.recording.scale_of_joint[k] * readings.col(scene.recording.channel_of_joint[k]);
    // Interpolated at 100 Hz from motions below 0.25 Hz.
    EXPECT_LT((value - scene.recording.joint_values.col(static_cast<Eigen::Index>(k)))
                  .cwiseAbs()
                  .maxCoeff(),
              1e-5);
  }
}

TEST(RandomRobot, FlipsAreAsManyAsAsked) {
  RecordingOptions o;
  o.flip_share = 0.2;
  const Scene scene = make_scene("FlipShare", {.joints = 3}, o);
  int flips = 0;
  int count = 0;
  for (const PoseTrack& track : scene.recording.tracks.tracks) {
    const Marker& m = *scene.robot.tree.marker(track.id);
    for (const PoseSample& s : track.samples) {
      const auto poses = forward_kinematics(scene.robot.tree,
                                            scene.recording.joint_values.row(s.frame).transpose());
      const Pose truth = scene.robot.T_camera_base * poses[m.link.index()] * m.T_link_marker;
      flips += angle_between(truth.rotation, s.T_camera_marker.rotation) > 0.05 ? 1 : 0;
      ++count;
    }
  }
  // 2400 draws: 0.8 % of spread; a flip seen head-on turns by nothing.
  EXPECT_NEAR(flips / static_cast<double>(count), 0.2, 0.04);
}

TEST(RandomRobot, AFlipMirrorsTheNormalAboutTheSight) {
  const Pose T{exp_rotation(Eigen::Vector3d(0.3, 0.2, 0.1)), Eigen::Vector3d(0.2, -0.1, 1.2)};
  const Pose flipped = flipped_pose(T);
  const Eigen::Vector3d sight = T.translation.normalized();
  const Eigen::Vector3d n = T.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d m = flipped.rotation * Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(n.dot(sight), m.dot(sight), 1e-12);
  EXPECT_LT((n + m - 2.0 * n.dot(sight) * sight).norm(), 1e-12);
  EXPECT_LT(angle_between(flipped_pose(flipped).rotation, T.rotation), 1e-9);
}

TEST(RandomRobot, TreesAreTreesAndParallelAxesAreParallel) {
  Rng rng = Rng::from_name("Trees");
  check_tree(random_robot({.joints = 12, .tree = true}, rng).tree);
  const RandomRobot scara = random_robot({.joints = 5, .parallel_axes = true}, rng);
  const auto poses = forward_kinematics(scara.tree, Eigen::VectorXd::Zero(5));
  for (std::size_t j = 1; j < 5; ++j) {
    const Eigen::Vector3d a = poses[j].rotation * scara.tree.joints[j].axis;
    const Eigen::Vector3d b = poses[0].rotation * scara.tree.joints[0].axis;
    EXPECT_NEAR(a.dot(b), 1.0, 1e-12);
  }
}

}  // namespace
}  // namespace kinescope
