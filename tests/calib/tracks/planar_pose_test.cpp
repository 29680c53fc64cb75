// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/planar_pose.h"

#include <cmath>

#include <gtest/gtest.h>

#include "calib/camera/marker_set.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr double kExact = 1e-8;  // rad, m: noise-free corners, Gauss-Newton to convergence

CameraModel camera_720p() {
  CameraModel camera = pinhole_guess(1280, 720, 900.0);
  camera.distortion = {-0.1, 0.05, 0.0007, -0.0003, 0.0};
  return camera;
}

// A marker that faces the camera, tilted at random by up to 60 degrees.
Pose random_view(Rng& rng, double distance_m) {
  Vector6d tilt = Vector6d::Zero();
  const double direction = rng.uniform(0.0, 6.28);
  const double angle = rng.uniform(0.2, 1.0);
  tilt.head<3>() << angle * std::cos(direction), angle * std::sin(direction), 0.0;
  Pose view = exp_pose(tilt);
  view.rotation = view.rotation * exp_rotation({0.0, 0.0, rng.uniform(-3.0, 3.0)});
  view.translation << rng.uniform(-0.3, 0.3) * distance_m, rng.uniform(-0.15, 0.15) * distance_m,
      distance_m;
  return view;
}

std::vector<Eigen::Vector2d> images(const CameraModel& camera, const Pose& T_camera_marker,
                                    const std::vector<Eigen::Vector3d>& corners) {
  std::vector<Eigen::Vector2d> pixels;
  for (const auto& corner : corners) pixels.push_back(*project(camera, T_camera_marker * corner));
  return pixels;
}

TEST(PlanarPose, RecoversThePoseOfCleanCorners) {
  Rng rng = Rng::from_name("planar pose clean");
  const auto corners = square_corners(0.05);
  for (int trial = 0; trial < 200; ++trial) {
    const Pose truth = random_view(rng, rng.uniform(0.3, 1.5));
    const auto pixels = images(camera_720p(), truth, corners);
    const auto found = estimate_planar_pose(camera_720p(), corners, pixels, 0.1);
    ASSERT_TRUE(found);
    EXPECT_LT(log_pose(truth.inverse() * found->best.T_camera_marker).norm(), kExact) << trial;
    EXPECT_LT(found->best.chi_square, kExact);
  }
}

TEST(PlanarPose, TheOtherBranchMirrorsTheNormal) {
  // A small tag far away: both branches explain it nearly as well, tilted to opposite sides.
  Rng rng = Rng::from_name("planar pose branches");
  const auto corners = square_corners(0.03);
  int with_other = 0;
  for (int trial = 0; trial < 50; ++trial) {
    const Pose truth = random_view(rng, 2.0);
    const auto found =
        estimate_planar_pose(camera_720p(), corners, images(camera_720p(), truth, corners), 0.1);
    ASSERT_TRUE(found);
    if (!found->other) continue;
    ++with_other;
    EXPECT_GT(found->other->chi_square, found->best.chi_square);
    EXPECT_GT(angle_between(found->other->T_camera_marker.rotation, truth.rotation), 0.1);
    EXPECT_LT((found->other->T_camera_marker.translation - truth.translation).norm(), 0.05);
  }
  EXPECT_GT(with_other, 40);
}

TEST(PlanarPose, CovarianceCoversTheScatter) {
  // chi-square of the pose error against the claimed covariance has mean 6 and variance 12.
  constexpr int kTrials = 600;
  constexpr double kSigma = 0.05;
  Rng rng = Rng::from_name("planar pose coverage");
  const auto corners = square_corners(0.08);
  double sum = 0.0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose truth = random_view(rng, 0.6);
    auto pixels = images(camera_720p(), truth, corners);
    for (auto& p : pixels) p += Eigen::Vector2d(rng.normal(kSigma), rng.normal(kSigma));
    const auto found = estimate_planar_pose(camera_720p(), corners, pixels, kSigma);
    ASSERT_TRUE(found);
    const Vector6d d = log_pose(found->best.T_camera_marker.inverse() * truth);
    sum += d.dot(found->best.covariance.ldlt().solve(d));
  }
  EXPECT_NEAR(sum / kTrials, 6.0, 4.0 * std::sqrt(12.0 / kTrials));
}

TEST(PlanarPose, RefusesCornersThatAreNoSquare) {
  const auto corners = square_corners(0.05);
  const std::vector<Eigen::Vector2d> line{{100, 100}, {110, 100}, {120, 100}, {130, 100}};
  EXPECT_FALSE(estimate_planar_pose(camera_720p(), corners, line, 0.1));
  const std::vector<Eigen::Vector2d> dot(4, {100, 100});
  EXPECT_FALSE(estimate_planar_pose(camera_720p(), corners, dot, 0.1));
  EXPECT_FALSE(estimate_planar_pose(camera_720p(), corners, {}, 0.1));
}

/// A small marker that sways, with corner noise as strong as the difference between its branches.
struct Swaying {
  MarkerSet markers;
  TagObservations observations;
  std::vector<Pose> truth;

  Swaying(double sigma_px, double declared_sigma_px) {
    Rng rng = Rng::from_name("planar pose time");
    markers.default_size_m = 0.05;
    observations.width = 1280;
    observations.height = 720;
    for (int frame = 0; frame < 200; ++frame) {
      const double t = frame / 30.0;
      Pose pose;
      pose.rotation = exp_rotation({0.6 + 0.1 * std::sin(t), 0.3 * std::cos(t), 0.2 * t});
      pose.translation << 0.1, 0.05, 1.6;
      truth.push_back(pose);
      observations.times_s.push_back(t);
      TagObservation seen;
      seen.frame = frame;
      seen.id = TagId{7};
      seen.sigma_px = declared_sigma_px;
      seen.corners_px = images(camera_720p(), pose, markers.corners_m(seen.id));
      for (auto& p : seen.corners_px) {
        p += Eigen::Vector2d(rng.normal(sigma_px), rng.normal(sigma_px));
      }
      observations.observations.push_back(seen);
    }
  }

  [[nodiscard]] bool is_wrong(int frame, const Pose& T_camera_marker) const {
    const Pose& expected = truth[static_cast<std::size_t>(frame)];
    return angle_between(T_camera_marker.rotation, expected.rotation) > 0.5;
  }
  [[nodiscard]] PoseTrack track() const {
    const PoseTracks tracks = pose_tracks_from_tags(observations, camera_720p(), markers);
    EXPECT_EQ(tracks.tracks.size(), 1U);
    EXPECT_EQ(tracks.tracks[0].samples.size(), 200U);
    return tracks.tracks[0];
  }
  [[nodiscard]] int wrong_in(const PoseTrack& track) const {
    int wrong = 0;
    for (const PoseSample& sample : track.samples) {
      if (is_wrong(sample.frame, sample.T_camera_marker)) ++wrong;
    }
    return wrong;
  }
};

TEST(PoseTracks, TimeChoosesTheBranchThatMovesSmoothly) {
  // Single views pick wrong often, the track must not.
  constexpr double kSigma = 0.15;
  const Swaying scene(kSigma, kSigma);
  int wrong_alone = 0;
  for (const TagObservation& seen : scene.observations.observations) {
    const auto alone = estimate_planar_pose(camera_720p(), scene.markers.corners_m(seen.id),
                                            seen.corners_px, kSigma);
    ASSERT_TRUE(alone);
    if (scene.is_wrong(seen.frame, alone->best.T_camera_marker)) ++wrong_alone;
  }
  EXPECT_GT(wrong_alone, 3);
  EXPECT_EQ(scene.wrong_in(scene.track()), 0);
}

TEST(PoseTracks, ViewsOfAMarkerAtRestErrByTheirCovariance) {
  // 20 px, nearly face on: its branches lie so close that single views jump between them all the
  // time, and the tilt that noise gives them shifts their depth.
  constexpr double kSigma = 0.13;
  constexpr int kFrames = 300;
  Rng rng = Rng::from_name("marker at rest");
  MarkerSet markers;
  markers.default_size_m = 0.029;
  TagObservations observations;
  observations.width = 1280;
  observations.height = 720;
  const Pose truth{exp_rotation({0.12, 0.1, 0.4}), {0.1, 0.05, 1.3}};
  for (int frame = 0; frame < kFrames; ++frame) {
    observations.times_s.push_back(frame / 30.0);
    TagObservation seen;
    seen.frame = frame;
    seen.id = TagId{7};
    seen.sigma_px = kSigma;
    seen.corners_px = images(camera_720p(), truth, markers.corners_m(seen.id));
    for (auto& p : seen.corners_px) p += Eigen::Vector2d(rng.normal(kSigma), rng.normal(kSigma));
    observations.observations.push_back(seen);
  }
  const PoseTracks tracks = pose_tracks_from_tags(observations, camera_720p(), markers);
  ASSERT_EQ(tracks.tracks.size(), 1U);
  ASSERT_EQ(tracks.tracks[0].samples.size(), kFrames);
  double squares = 0.0;
  for (const PoseSample& s : tracks.tracks[0].samples) {
    EXPECT_FALSE(s.T_camera_marker_alternative) << s.frame;
    const Vector6d error = log_pose(truth.inverse() * s.T_camera_marker);
    squares += error.dot(solve_symmetric(s.covariance, error));
  }
  // Chi-square of six degrees of freedom a view; its mean is off by 0.2 in one of a thousand.
  EXPECT_NEAR(squares / kFrames, 6.0, 0.7);
}

// A joint that is moved by itself, in its turn: its marker rests for most of the time. Views of
// its motion were linearised about that rest.
TEST(PoseTracks, AMarkerThatMovesForAWhileIsWhereItIs) {
  constexpr double kSigma = 0.05;
  constexpr int kFrames = 150;
  Rng rng = Rng::from_name("moves for a while");
  MarkerSet markers;
  markers.default_size_m = 0.06;
  TagObservations observations;
  observations.width = 1280;
  observations.height = 720;
  std::vector<Pose> truth;
  for (int frame = 0; frame < kFrames; ++frame) {
    observations.times_s.push_back(frame / 30.0);
    const double turn =
        0.9 * std::sin(2.0 * std::numbers::pi * std::clamp(frame - 50, 0, 50) / 50.0);
    truth.push_back(Pose{exp_rotation({0.5, 0.2, 0.0}), {0.0, 0.0, 1.0}} *
                    Pose{exp_rotation({0.0, 0.0, turn}), Eigen::Vector3d::Zero()} *
                    Pose{exp_rotation({0.1, 0.3, 0.4}), {0.1, 0.05, 0.0}});
    TagObservation seen;
    seen.frame = frame;
    seen.id = TagId{7};
    seen.sigma_px = kSigma;
    seen.corners_px = images(camera_720p(), truth.back(), markers.corners_m(seen.id));
    for (auto& p : seen.corners_px) p += Eigen::Vector2d(rng.normal(kSigma), rng.normal(kSigma));
    observations.observations.push_back(seen);
  }
  const PoseTracks tracks = pose_tracks_from_tags(observations, camera_720p(), markers);
  ASSERT_EQ(tracks.tracks.size(), 1U);
  for (const PoseSample& s : tracks.tracks[0].samples) {
    const Pose error = truth[static_cast<std::size_t>(s.frame)].inverse() * s.T_camera_marker;
    EXPECT_LT(log_rotation(error.rotation).norm(), 0.03) << s.frame;
  }
}

TEST(PoseTracks, TheOtherBranchHasACovarianceOfItsOwn) {
  const Swaying scene(0.05, 0.05);
  std::vector<double> squared;
  for (const PoseSample& s : scene.track().samples) {
    ASSERT_TRUE(s.T_camera_marker_alternative);
    ASSERT_TRUE(s.alternative_covariance);
    // The corners tell a marker's place across the line of sight far better than along it.
    const Eigen::Vector3d sight = s.T_camera_marker_alternative->rotation.conjugate() *
                                  s.T_camera_marker_alternative->translation.normalized();
    const Eigen::Matrix3d place = s.alternative_covariance->bottomRightCorner<3, 3>();
    squared.push_back(sight.dot(place * sight) / place.trace());
  }
  EXPECT_GT(median_of(squared), 0.98);
}

TEST(PoseTracks, TheNoiseIsTakenFromTheCornersWhereItIsMoreThanDeclared) {
  constexpr double kSigma = 0.5;
  const PoseTrack right = Swaying(kSigma, kSigma).track();
  const Swaying scene(kSigma, 0.1);  // as assumed for a corners.csv without sigma
  const PoseTrack track = scene.track();
  std::vector<double> shares;
  for (std::size_t i = 0; i < track.samples.size(); ++i) {
    shares.push_back(track.samples[i].covariance.trace() / right.samples[i].covariance.trace());
  }
  // Declared alone it would be 0.04. The better one of two branches that are nearly alike takes up
  // a part of the noise.
  EXPECT_GT(median_of(shares), 0.5);
  EXPECT_LT(median_of(shares), 1.3);
  EXPECT_EQ(scene.wrong_in(track), scene.wrong_in(right));
}

TEST(PoseTracks, FocalLengthFromShapes) {
  constexpr double kFocalTolerance = 20.0;  // px: about 4 sigma of 120 views at 0.05 px
  Rng rng = Rng::from_name("focal from tags");
  MarkerSet markers;
  markers.default_size_m = 0.1;
  CameraModel camera = pinhole_guess(1280, 720, 905.0);
  TagObservations observations;
  observations.width = 1280;
  observations.height = 720;
  for (int frame = 0; frame < 150; ++frame) {
    observations.times_s.push_back(frame);
    TagObservation seen;
    seen.frame = frame;
    seen.id = TagId{1};
    seen.sigma_px = 0.05;
    seen.corners_px = images(camera, random_view(rng, 0.6), markers.corners_m(seen.id));
    for (auto& p : seen.corners_px) p += Eigen::Vector2d(rng.normal(0.05), rng.normal(0.05));
    observations.observations.push_back(seen);
  }
  EXPECT_NEAR(focal_from_tags(observations, markers), 905.0, kFocalTolerance);
}

}  // namespace
}  // namespace kinescope
