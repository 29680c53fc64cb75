// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/equidistant_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <ceres/cost_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "calib/vision/board_fit.h"
#include "kinematics/core/silence_glog.h"

namespace kinescope {
namespace {

// A lens and the poses of the views that it explains.
struct Bundle {
  CameraModel camera;
  std::vector<BoardSight> views;
  std::vector<Pose> poses;
};

struct PosedViews {
  Bundle bundle;
  // Over all views, so that a misread one has no say; infinite where half of them have no pose.
  double median_rms_px = std::numeric_limits<double>::infinity();
};

PosedViews pose_views(const CameraModel& camera, const std::vector<BoardSight>& views) {
  PosedViews out{{camera, {}, {}}};
  std::vector<double> rms(views.size(), std::numeric_limits<double>::infinity());
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto fit = fit_view(camera, views[v]);
    if (!fit) continue;
    rms[v] = fit->rms_px;
    out.bundle.views.push_back(views[v]);
    out.bundle.poses.push_back(fit->T_camera_board);
  }
  std::ranges::sort(rms);
  if (!rms.empty()) out.median_rms_px = rms[rms.size() / 2];
  return out;
}

// The focal length under which poses alone explain the views best.
PosedViews best_start(const std::vector<BoardSight>& views, int width, int height) {
  // From a telephoto lens to one that sees all round.
  constexpr double kNarrowest_deg = 10.0;  // between the axis and the middle of the image's rim
  constexpr double kWidest_deg = 120.0;
  constexpr double kStep = 1.25;
  const double half = 0.5 * std::max(width, height);
  PosedViews best;
  for (double angle = kNarrowest_deg; angle <= kWidest_deg; angle *= kStep) {
    CameraModel camera = pinhole_guess(width, height, half / (angle * std::numbers::pi / 180.0));
    camera.model = DistortionModel::kEquidistant;
    PosedViews start = pose_views(camera, views);
    if (start.median_rms_px < best.median_rms_px) best = std::move(start);
  }
  return best;
}

constexpr int kIntrinsics = 8;  // fx, fy, cx, cy, k1 to k4
using Intrinsics = Eigen::Matrix<double, kIntrinsics, 1>;

Intrinsics intrinsics_of(const CameraModel& camera) {
  Intrinsics out;
  out << camera.fx, camera.fy, camera.cx, camera.cy, camera.distortion[0], camera.distortion[1],
      camera.distortion[2], camera.distortion[3];
  return out;
}

CameraModel camera_of(CameraModel camera, const double* intrinsics) {
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  std::copy_n(intrinsics + 4, kIntrinsics - 4, camera.distortion.begin());
  return camera;
}

// Blocks: intrinsics, and a step (6) of the board's pose from its start.
class BoardCost final : public ceres::CostFunction {
 public:
  BoardCost(const CameraModel& camera, const BoardSight& view, const Pose& start)
      : camera_(&camera), view_(&view), start_(start) {
    set_num_residuals(2 * static_cast<int>(view.pixels.size()));
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
    for (std::size_t i = 0; i < view_->pixels.size(); ++i) {
      const Eigen::Vector3d& place_m = view_->places_m[i];
      const auto at = project_with_derivatives(camera, T * place_m);
      if (!at) return false;
      const auto row = static_cast<Eigen::Index>(2 * i);
      Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()).segment<2>(row) =
          at->pixel - view_->pixels[i];
      if (jacobians == nullptr) continue;
      if (jacobians[0] != nullptr) {
        Eigen::Map<RowMajor>(jacobians[0], num_residuals(), kIntrinsics).middleRows<2>(row) =
            at->d_intrinsics.leftCols<kIntrinsics>();
      }
      if (jacobians[1] != nullptr) {
        Eigen::Matrix<double, 3, 6> d_point;
        d_point << -R * skew(place_m), R;
        Eigen::Map<RowMajor>(jacobians[1], num_residuals(), 6).middleRows<2>(row) =
            at->d_point * d_point * right;
      }
    }
    return true;
  }

 private:
  const CameraModel* camera_;
  const BoardSight* view_;
  Pose start_;
};

// Lens and poses together.
CameraModel refined(const Bundle& start) {
  Intrinsics intrinsics = intrinsics_of(start.camera);
  std::vector<Vector6d> steps(start.views.size(), Vector6d::Zero());
  ceres::Problem problem;
  for (std::size_t v = 0; v < start.views.size(); ++v) {
    problem.AddResidualBlock(new BoardCost(start.camera, start.views[v], start.poses[v]), nullptr,
                             intrinsics.data(), steps[v].data());
  }
  silence_glog();
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  const bool sane =
      summary.IsSolutionUsable() && intrinsics.allFinite() && intrinsics.head<2>().minCoeff() > 0.0;
  return sane ? camera_of(start.camera, intrinsics.data()) : start.camera;
}

}  // namespace

std::optional<CameraModel> estimate_equidistant(const std::vector<BoardSight>& views, int width,
                                                int height) {
  PosedViews posed = best_start(views, width, height);
  // Twice: views at the rim have a pose only once the lens is about right.
  for (int pass = 0; pass < 2; ++pass) {
    if (!std::isfinite(posed.median_rms_px)) return std::nullopt;
    posed = pose_views(refined(posed.bundle), views);
  }
  if (!std::isfinite(posed.median_rms_px)) return std::nullopt;
  return posed.bundle.camera;
}

}  // namespace kinescope
