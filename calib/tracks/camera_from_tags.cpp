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

// Blocks: intrinsics (focal length, cx, cy, k1, k2) and a step (6) of the view's pose from its
// start.
constexpr int kIntrinsics = 5;
using Intrinsics = Eigen::Matrix<double, kIntrinsics, 1>;

CameraModel camera_of(CameraModel camera, const double* intrinsics) {
  camera.fx = camera.fy = intrinsics[0];
  camera.cx = intrinsics[1];
  camera.cy = intrinsics[2];
  camera.distortion[0] = intrinsics[3];
  camera.distortion[1] = intrinsics[4];
  return camera;
}

Intrinsics intrinsics_of(const CameraModel& camera) {
  Intrinsics out;
  out << camera.fx, camera.cx, camera.cy, camera.distortion[0], camera.distortion[1];
  return out;
}

class ViewCost final : public ceres::CostFunction {
 public:
  ViewCost(const CameraModel& camera, const TagObservation& view,
           std::vector<Eigen::Vector3d> corners_m, const Pose& start)
      : camera_(&camera), view_(&view), corners_m_(std::move(corners_m)), start_(start) {
    set_num_residuals(2 * static_cast<int>(corners_m_.size()));
    *mutable_parameter_block_sizes() = {kIntrinsics, 6};
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const CameraModel camera = camera_of(*camera_, parameters[0]);
    const Vector6d step = Eigen::Map<const Vector6d>(parameters[1]);
    const Pose T = start_ * exp_pose(step);
    const Eigen::Matrix3d R = T.matrix3();
    const Matrix6d right = inverse_right_jacobian(step).inverse();
    for (std::size_t i = 0; i < corners_m_.size(); ++i) {
      const auto at = project_with_derivatives(camera, T * corners_m_[i]);
      if (!at) return false;
      const auto row = static_cast<Eigen::Index>(2 * i);
      Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()).segment<2>(row) =
          (at->pixel - view_->corners_px[i]) / view_->sigma_px;
      if (jacobians == nullptr) continue;
      if (jacobians[0] != nullptr) {
        Eigen::Map<RowMajor> out(jacobians[0], num_residuals(), kIntrinsics);
        out.middleRows<2>(row).col(0) = at->d_intrinsics.col(0) + at->d_intrinsics.col(1);
        out.middleRows<2>(row).rightCols<4>() = at->d_intrinsics.middleCols<4>(2);
        out.middleRows<2>(row) /= view_->sigma_px;
      }
      if (jacobians[1] != nullptr) {
        Eigen::Matrix<double, 3, 6> d_point;
        d_point << -R * skew(corners_m_[i]), R;
        Eigen::Map<RowMajor>(jacobians[1], num_residuals(), 6).middleRows<2>(row) =
            at->d_point * d_point * right / view_->sigma_px;
      }
    }
    return true;
  }

 private:
  const CameraModel* camera_;
  const TagObservation* view_;
  std::vector<Eigen::Vector3d> corners_m_;
  Pose start_;
};

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
  problem.AddResidualBlock(new ceres::NormalPrior(weights, intrinsics_of(guess)), nullptr,
                           intrinsics);
}

// Intrinsics and poses from a camera that is nearly right; the camera itself where that fails.
CameraModel refined(const CameraModel& camera, const CameraModel& guess,
                    const std::vector<const TagObservation*>& views, const MarkerSet& markers) {
  Intrinsics intrinsics = intrinsics_of(camera);
  std::vector<Vector6d> steps(views.size(), Vector6d::Zero());
  ceres::Problem problem;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const TagObservation& view = *views[v];
    const std::vector<Eigen::Vector3d> corners_m = markers.corners_m(view.id);
    const auto pose = estimate_planar_pose(camera, corners_m, view.corners_px, view.sigma_px);
    if (!pose) continue;
    if (pose->other && pose->other->chi_square - pose->best.chi_square < kUndecided) continue;
    problem.AddResidualBlock(new ViewCost(camera, view, corners_m, pose->best.T_camera_marker),
                             new ceres::CauchyLoss(kLossWidth), intrinsics.data(), steps[v].data());
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
  return sane ? camera_of(camera, intrinsics.data()) : camera;
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
