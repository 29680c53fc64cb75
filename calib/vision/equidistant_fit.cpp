// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/equidistant_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "calib/vision/board_fit.h"
#include "kinematics/core/dense_algebra.h"

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

std::optional<double> squared_error(const Bundle& bundle) {
  double sum = 0.0;
  for (std::size_t v = 0; v < bundle.views.size(); ++v) {
    const BoardSight& view = bundle.views[v];
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      const auto pixel = project(bundle.camera, bundle.poses[v] * view.places_m[i]);
      if (!pixel) return std::nullopt;
      sum += (view.pixels[i] - *pixel).squaredNorm();
    }
  }
  return std::isfinite(sum) ? std::optional(sum) : std::nullopt;
}

void move_intrinsics(CameraModel& camera, const Eigen::VectorXd& step) {
  camera.fx += step(0);
  camera.fy += step(1);
  camera.cx += step(2);
  camera.cy += step(3);
  for (Eigen::Index i = 4; i < step.size(); ++i) {
    camera.distortion[static_cast<std::size_t>(i - 4)] += step(i);
  }
}

// One step of Levenberg-Marquardt with Marquardt's scaling; nothing where it cannot be taken.
std::optional<Bundle> stepped(const Bundle& bundle, const std::vector<ViewNormals>& normals,
                              double damping) {
  const Eigen::Index n = normals.front().A.rows();
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
  for (const ViewNormals& view : normals) S += view.A;
  S.diagonal() *= 1.0 + damping;
  std::vector<Eigen::MatrixXd> C(normals.size());
  for (std::size_t v = 0; v < normals.size(); ++v) {
    const ViewNormals& view = normals[v];
    C[v] = view.C;
    C[v].diagonal() *= 1.0 + damping;
    S -= view.B * solve_symmetric(C[v], Eigen::MatrixXd(view.B.transpose()));
    g += view.g_intrinsics - view.B * solve_symmetric(C[v], view.g_pose);
  }
  // Terms of theta^3 to theta^9 beside focal lengths in px: scaled to a unit diagonal.
  const Eigen::VectorXd scale = unit_scale(S);
  const Eigen::MatrixXd scaled = scale.asDiagonal() * S * scale.asDiagonal();
  const Eigen::VectorXd right = scale.cwiseProduct(g);
  const Eigen::VectorXd step = scale.cwiseProduct(solve_symmetric(scaled, right));
  if (!step.allFinite()) return std::nullopt;
  Bundle out = bundle;
  move_intrinsics(out.camera, step);
  if (!(out.camera.fx > 0.0) || !(out.camera.fy > 0.0)) return std::nullopt;
  for (std::size_t v = 0; v < normals.size(); ++v) {
    const Eigen::VectorXd right_pose = normals[v].g_pose - normals[v].B.transpose() * step;
    const Vector6d move = solve_symmetric(C[v], right_pose);
    if (!move.allFinite()) return std::nullopt;
    out.poses[v] = out.poses[v] * exp_pose(move);
  }
  return out;
}

Bundle refined(Bundle bundle, const std::vector<int>& free) {
  constexpr int kRounds = 200;
  constexpr double kConverged = 1e-12;  // change of the squared error, as a share
  constexpr double kMaxDamping = 1e10;
  auto now = squared_error(bundle);
  double damping = 1e-3;
  for (int round = 0; round < kRounds && now; ++round) {
    std::vector<ViewNormals> normals;
    for (std::size_t v = 0; v < bundle.views.size(); ++v) {
      const auto view = view_normals(bundle.camera, bundle.poses[v], bundle.views[v], free);
      if (!view) return bundle;
      normals.push_back(*view);
    }
    std::optional<double> next;
    for (; damping < kMaxDamping; damping *= 10.0) {
      const auto trial = stepped(bundle, normals, damping);
      next = trial ? squared_error(*trial) : std::nullopt;
      if (!next || !(*next <= *now)) continue;
      bundle = *trial;
      damping *= 0.1;
      break;
    }
    if (damping >= kMaxDamping || *now - *next <= kConverged * *now) break;
    now = next;
  }
  return bundle;
}

}  // namespace

std::optional<CameraModel> estimate_equidistant(const std::vector<BoardSight>& views, int width,
                                                int height) {
  PosedViews posed = best_start(views, width, height);
  const std::vector<int> free = free_intrinsics({.model = DistortionModel::kEquidistant});
  // Twice: views at the rim have a pose only once the lens is about right.
  for (int pass = 0; pass < 2; ++pass) {
    if (!std::isfinite(posed.median_rms_px)) return std::nullopt;
    posed = pose_views(refined(std::move(posed.bundle), free).camera, views);
  }
  if (!std::isfinite(posed.median_rms_px)) return std::nullopt;
  return posed.bundle.camera;
}

}  // namespace kinescope
