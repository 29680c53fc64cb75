// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/equidistant_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <ceres/cost_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "calib/camera/view_cost.h"
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

// fx, fy, cx, cy, k1 to k4.
FreeIntrinsics free_intrinsics() {
  constexpr int kFree = 8;
  return FreeIntrinsics::Identity(kMaxIntrinsics, kFree);
}

// Lens and poses together.
CameraModel refined(const Bundle& start) {
  const FreeIntrinsics free = free_intrinsics();
  Eigen::VectorXd intrinsics = numbers_of(start.camera, free);
  std::vector<Vector6d> steps(start.views.size(), Vector6d::Zero());
  ceres::Problem problem;
  for (std::size_t v = 0; v < start.views.size(); ++v) {
    const BoardSight& view = start.views[v];
    auto cost =
        make_view_cost(start.camera, free, {view.places_m, view.pixels, 1.0, start.poses[v]});
    problem.AddResidualBlock(cost.release(), nullptr, intrinsics.data(), steps[v].data());
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
  return sane ? camera_at(start.camera, free, intrinsics.data()) : start.camera;
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
