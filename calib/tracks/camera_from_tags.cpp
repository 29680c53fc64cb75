// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/camera_from_tags.h"

#include <cmath>
#include <limits>
#include <vector>

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "calib/camera/view_cost.h"
#include "calib/tracks/planar_pose.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "kinematics/core/silence_glog.h"
#include "kinematics/core/student_t.h"

namespace kinescope {
namespace {

constexpr std::size_t kMostViews = 1500;
// Below this difference of chi-square between its two branches a view's pose is anybody's guess.
constexpr double kUndecided = 6.0;
// The second time branches and starts are those of the first camera.
constexpr int kRounds = 2;
constexpr double kLossWidth = 3.0;
// What lenses are like, one standard deviation: where the views say less, that is what counts.
constexpr double kCentreSigma = 0.03;  // of the image's width
constexpr double kDistortionSigma = 0.3;

// One focal length, cx, cy, k1, k2.
constexpr int kIntrinsics = 5;

FreeIntrinsics free_intrinsics() {
  FreeIntrinsics out = FreeIntrinsics::Zero(kMaxIntrinsics, kIntrinsics);
  out(0, 0) = 1.0;
  out.bottomRows<kMaxIntrinsics - 1>().topRows<kIntrinsics>().setIdentity();
  return out;
}

// Spread evenly over the recording, whatever they look like: the most tilted ones would be those
// whose noise looks like tilt.
std::vector<const TagObservation*> chosen_views(const TagObservations& observations) {
  const std::size_t all = observations.observations.size();
  const std::size_t count = std::min(all, kMostViews);
  std::vector<const TagObservation*> out;
  for (std::size_t k = 0; k < count; ++k) {
    out.push_back(&observations.observations[k * all / count]);
  }
  return out;
}

// What would be there without any view.
void add_prior(const CameraModel& guess, double* intrinsics, ceres::Problem& problem) {
  ceres::Matrix weights = ceres::Matrix::Zero(kIntrinsics, kIntrinsics);
  weights(1, 1) = weights(2, 2) = 1.0 / (kCentreSigma * guess.width);
  weights(3, 3) = weights(4, 4) = 1.0 / kDistortionSigma;
  problem.AddResidualBlock(new ceres::NormalPrior(weights, numbers_of(guess, free_intrinsics())),
                           nullptr, intrinsics);
}

// Intrinsics and poses from a camera that is nearly right; the camera itself where that fails.
CameraModel refined(const CameraModel& camera, const CameraModel& guess,
                    const std::vector<const TagObservation*>& views, const MarkerSet& markers) {
  const FreeIntrinsics free = free_intrinsics();
  Eigen::VectorXd intrinsics = numbers_of(camera, free);
  std::vector<Vector6d> steps(views.size(), Vector6d::Zero());
  ceres::Problem problem;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const TagObservation& view = *views[v];
    const std::vector<Eigen::Vector3d> corners_m = markers.corners_m(view.id);
    const auto pose = estimate_planar_pose(camera, corners_m, view.corners_px, view.sigma_px);
    if (!pose) continue;
    if (pose->other && pose->other->chi_square - pose->best.chi_square < kUndecided) continue;
    auto cost = make_view_cost(
        camera, free, {corners_m, view.corners_px, view.sigma_px, pose->best.T_camera_marker});
    problem.AddResidualBlock(cost.release(), new ceres::CauchyLoss(kLossWidth), intrinsics.data(),
                             steps[v].data());
  }
  if (problem.NumResidualBlocks() == 0) return camera;
  add_prior(guess, intrinsics.data(), problem);
  silence_glog();
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = 50;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  const bool sane = summary.IsSolutionUsable() && intrinsics.allFinite() && intrinsics[0] > 0.0;
  return sane ? camera_at(camera, free, intrinsics.data()) : camera;
}

}  // namespace

CameraModel camera_from_tags(const TagObservations& observations, const MarkerSet& markers) {
  const CameraModel guess = pinhole_guess(observations.width, observations.height,
                                          focal_from_tags(observations, markers));
  const std::vector<const TagObservation*> views = chosen_views(observations);
  CameraModel camera = guess;
  for (int round = 0; round < kRounds; ++round) camera = refined(camera, guess, views, markers);
  return camera;
}

double log_odds_of_shapes(const CameraModel& of, const CameraModel& against,
                          const TagObservations& observations, const MarkerSet& markers) {
  std::vector<double> left_of, left_against;  // chi-square
  for (const TagObservation* view : chosen_views(observations)) {
    const std::vector<Eigen::Vector3d> corners_m = markers.corners_m(view->id);
    const auto one = estimate_planar_pose(of, corners_m, view->corners_px, view->sigma_px);
    const auto other = estimate_planar_pose(against, corners_m, view->corners_px, view->sigma_px);
    if (!one || !other) continue;
    left_of.push_back(one->best.chi_square);
    left_against.push_back(other->best.chi_square);
  }
  constexpr double kLeft = 2.0;     // coordinates of a square: eight less the six of its pose
  constexpr double kExact = 1e-12;  // of the declared noise, squared
  return 0.5 * (fit_student_t(left_against, kLeft, kExact).deviance -
                fit_student_t(left_of, kLeft, kExact).deviance);
}

}  // namespace kinescope
