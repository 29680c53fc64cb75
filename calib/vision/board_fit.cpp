// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/board_fit.h"

#include <algorithm>
#include <cmath>

#include <opencv2/calib3d.hpp>

#include "calib/vision/equidistant_fit.h"
#include "kinematics/core/dense_algebra.h"

namespace kinescope {
namespace {

// d pixel / d (rotation, translation) of the board's pose, perturbed on the right.
Eigen::Matrix<double, 2, 6> pose_jacobian(const Projection& projection, const Pose& pose,
                                          const Eigen::Vector3d& place) {
  const Eigen::Matrix3d R = pose.matrix3();
  Eigen::Matrix<double, 2, 6> J;
  J.leftCols<3>() = -projection.d_point * R * skew(place);
  J.rightCols<3>() = projection.d_point * R;
  return J;
}

// Starts for the pose from undistorted points: a plane's picture has two explanations.
std::vector<Pose> start_poses(const CameraModel& camera, const BoardSight& view) {
  std::vector<cv::Point3d> places;
  std::vector<cv::Point2d> rays;
  for (std::size_t i = 0; i < view.pixels.size(); ++i) {
    const auto ray = unproject(camera, view.pixels[i]);
    if (!ray) continue;
    places.emplace_back(view.places_m[i].x(), view.places_m[i].y(), view.places_m[i].z());
    rays.emplace_back(ray->x(), ray->y());
  }
  std::vector<Pose> out;
  if (places.size() < 4) return out;
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  try {
    cv::solvePnPGeneric(places, rays, cv::Matx33d::eye(), cv::noArray(), rotations, translations,
                        false, cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {
    return out;
  }
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    const cv::Mat& r = rotations[i];
    const cv::Mat& t = translations[i];
    Pose pose;
    pose.rotation = exp_rotation({r.at<double>(0), r.at<double>(1), r.at<double>(2)});
    pose.translation = {t.at<double>(0), t.at<double>(1), t.at<double>(2)};
    out.push_back(pose);
  }
  return out;
}

CameraModel from_opencv(const cv::Mat& K, const cv::Mat& distortion, int width, int height,
                        DistortionModel model) {
  CameraModel camera;
  camera.width = width;
  camera.height = height;
  camera.fx = K.at<double>(0, 0);
  camera.fy = K.at<double>(1, 1);
  camera.cx = K.at<double>(0, 2);
  camera.cy = K.at<double>(1, 2);
  camera.model = model;
  for (int i = 0; i < distortion_count(model); ++i) {
    camera.distortion[static_cast<std::size_t>(i)] = distortion.at<double>(i);
  }
  return camera;
}

}  // namespace

std::optional<CameraModel> estimate_intrinsics(const std::vector<BoardSight>& views, int width,
                                               int height, const BoardOptions& options) {
  if (options.model == DistortionModel::kEquidistant) {
    return estimate_equidistant(views, width, height);
  }
  std::vector<std::vector<cv::Point3f>> places;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const BoardSight& view : views) {
    places.emplace_back();
    pixels.emplace_back();
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      places.back().emplace_back(static_cast<float>(view.places_m[i].x()),
                                 static_cast<float>(view.places_m[i].y()), 0.0F);
      pixels.back().emplace_back(static_cast<float>(view.pixels[i].x()),
                                 static_cast<float>(view.pixels[i].y()));
    }
  }
  cv::Mat K;
  cv::Mat distortion = cv::Mat::zeros(1, 8, CV_64F);
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  const cv::TermCriteria criteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 200, 1e-12);
  int flags = 0;
  if (options.model == DistortionModel::kRationalPolynomial) {
    flags |= cv::CALIB_RATIONAL_MODEL;
  } else if (options.fix_k3) {
    flags |= cv::CALIB_FIX_K3;
  }
  try {
    cv::calibrateCamera(places, pixels, {width, height}, K, distortion, rotations, translations,
                        flags, criteria);
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  if (!cv::checkRange(K) || !cv::checkRange(distortion)) return std::nullopt;
  if (!(K.at<double>(0, 0) > 0.0) || !(K.at<double>(1, 1) > 0.0)) return std::nullopt;
  cv::Mat terms = cv::Mat::zeros(1, 8, CV_64F);
  for (int i = 0; i < std::min(8, static_cast<int>(distortion.total())); ++i) {
    terms.at<double>(i) = distortion.at<double>(i);
  }
  return from_opencv(K, terms, width, height, options.model);
}

namespace {

std::optional<ViewFit> fit_from(const CameraModel& camera, const BoardSight& view,
                                const Pose& start) {
  ViewFit fit{start, {}, 0.0};
  constexpr int kRounds = 20;
  for (int round = 0; round < kRounds; ++round) {
    Matrix6d H = Matrix6d::Zero();
    Vector6d g = Vector6d::Zero();
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      const auto p = project_with_derivatives(camera, fit.T_camera_board * view.places_m[i]);
      if (!p) return std::nullopt;
      const auto J = pose_jacobian(*p, fit.T_camera_board, view.places_m[i]);
      H += J.transpose() * J;
      g += J.transpose() * (view.pixels[i] - p->pixel);
    }
    const Vector6d step = solve_symmetric(H, g);
    if (!step.allFinite()) return std::nullopt;
    fit.T_camera_board = fit.T_camera_board * exp_pose(step);
    constexpr double kSmallStep = 1e-12;
    if (step.norm() < kSmallStep) break;
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < view.pixels.size(); ++i) {
    const auto pixel = project(camera, fit.T_camera_board * view.places_m[i]);
    if (!pixel) return std::nullopt;
    fit.residuals_px.emplace_back(view.pixels[i] - *pixel);
    sum += fit.residuals_px.back().squaredNorm();
  }
  fit.rms_px = std::sqrt(sum / static_cast<double>(view.pixels.size()));
  return fit;
}

}  // namespace

std::optional<ViewFit> fit_view(const CameraModel& camera, const BoardSight& view) {
  std::optional<ViewFit> best;
  for (const Pose& start : start_poses(camera, view)) {
    std::optional<ViewFit> fit = fit_from(camera, view, start);
    if (fit && (!best || fit->rms_px < best->rms_px)) best = std::move(fit);
  }
  return best;
}

std::vector<int> free_intrinsics(const BoardOptions& options) {
  std::vector<int> free;
  for (int i = 0; i < 4 + distortion_count(options.model); ++i) {
    const bool k3 = options.model == DistortionModel::kPlumbBob && i == 8;
    if (!(k3 && options.fix_k3)) free.push_back(i);
  }
  return free;
}

std::optional<Eigen::MatrixXd> intrinsic_covariance(const CameraModel& camera,
                                                    const std::vector<BoardSight>& views,
                                                    const std::vector<ViewFit>& fits,
                                                    const std::vector<int>& free) {
  const auto n = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(n, n);  // intrinsics' information, poses eliminated
  double squared = 0.0;
  Eigen::Index measured = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
    Eigen::MatrixXd B = Eigen::MatrixXd::Zero(n, 6);
    Matrix6d C = Matrix6d::Zero();
    for (std::size_t i = 0; i < views[v].pixels.size(); ++i) {
      const auto p =
          project_with_derivatives(camera, fits[v].T_camera_board * views[v].places_m[i]);
      if (!p) return std::nullopt;
      const Eigen::MatrixXd Ji = p->d_intrinsics(Eigen::all, free);
      const auto Jp = pose_jacobian(*p, fits[v].T_camera_board, views[v].places_m[i]);
      A += Ji.transpose() * Ji;
      B += Ji.transpose() * Jp;
      C += Jp.transpose() * Jp;
      squared += fits[v].residuals_px[i].squaredNorm();
      measured += 2;
    }
    S += A - B * solve_symmetric(Eigen::MatrixXd(C), Eigen::MatrixXd(B.transpose()));
  }
  const Eigen::Index freedom = measured - n - 6 * static_cast<Eigen::Index>(views.size());
  if (freedom <= 0) return std::nullopt;
  // Scaled to a unit diagonal, so that the test of rank is free of units.
  const Eigen::VectorXd d = S.diagonal();
  if (!(d.minCoeff() > 0.0)) return std::nullopt;
  const Eigen::VectorXd scale = d.cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * S * scale.asDiagonal();
  const SymmetricEigen eigen = symmetric_eigen(scaled);
  constexpr double kSingular = 1e-11;
  if (!(eigen.values.minCoeff() > kSingular)) return std::nullopt;
  const Eigen::MatrixXd inverse =
      eigen.vectors * eigen.values.cwiseInverse().asDiagonal() * eigen.vectors.transpose();
  return Eigen::MatrixXd(scale.asDiagonal() * inverse * scale.asDiagonal() * squared /
                         static_cast<double>(freedom));
}

}  // namespace kinescope
