// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/planar_pose.h"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/LU>

#include "kinematics/core/dense_algebra.h"

namespace kinescope {
namespace {

constexpr int kMaxIterations = 40;
// Two refined branches closer than this (rad) are one pose.
constexpr double kSameBranch = 1e-3;

// Homography from plane to normalised image coordinates by the direct linear transform; coordinates
// are of order one already. Nothing when the corners do not span the plane.
std::optional<Eigen::Matrix3d> homography(std::span<const Eigen::Vector2d> plane,
                                          std::span<const Eigen::Vector2d> image) {
  const auto n = static_cast<Eigen::Index>(plane.size());
  Eigen::MatrixXd A(2 * n, 9);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector2d& p = plane[static_cast<std::size_t>(i)];
    const Eigen::Vector2d& x = image[static_cast<std::size_t>(i)];
    A.row(2 * i) << p.x(), p.y(), 1, 0, 0, 0, -x.x() * p.x(), -x.x() * p.y(), -x.x();
    A.row(2 * i + 1) << 0, 0, 0, p.x(), p.y(), 1, -x.y() * p.x(), -x.y() * p.y(), -x.y();
  }
  const SymmetricEigen eigen = symmetric_eigen(A.transpose() * A);
  if (eigen.values[1] < 1e-12 * eigen.values[8]) return std::nullopt;
  const Eigen::VectorXd h = eigen.vectors.col(0);
  Eigen::Matrix3d H;
  H << h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8];
  if (std::abs(H(2, 2)) < 1e-12 * H.norm()) return std::nullopt;
  return H / H(2, 2);
}

// Both rotations that share the homography's first derivative at the origin of the plane.
// Collins and Bartoli 2014, section 3 and appendix A.
std::optional<std::array<Eigen::Matrix3d, 2>> ippe_rotations(const Eigen::Matrix3d& H) {
  const Eigen::Vector2d v = H.topRightCorner<2, 1>();
  const Eigen::Matrix2d J = H.topLeftCorner<2, 2>() - v * H.bottomLeftCorner<1, 2>();
  const Eigen::Matrix3d Rv =
      rotation_to_axis(Eigen::Vector3d(v.x(), v.y(), 1.0).normalized()).toRotationMatrix();
  Eigen::Matrix<double, 2, 3> P;
  P << 1, 0, -v.x(), 0, 1, -v.y();
  const Eigen::Matrix2d B = P * Rv.leftCols<2>();
  if (std::abs(B.determinant()) < 1e-12) return std::nullopt;
  const Eigen::Matrix2d A = B.inverse() * J;
  // The larger singular value.
  const double gamma = 0.5 * (std::hypot(A(0, 0) + A(1, 1), A(1, 0) - A(0, 1)) +
                              std::hypot(A(0, 0) - A(1, 1), A(1, 0) + A(0, 1)));
  if (!(gamma > 0.0)) return std::nullopt;
  const Eigen::Matrix2d R22 = A / gamma;
  const Eigen::Matrix2d rest = Eigen::Matrix2d::Identity() - R22.transpose() * R22;
  Eigen::Vector2d b(std::sqrt(std::max(0.0, rest(0, 0))), std::sqrt(std::max(0.0, rest(1, 1))));
  if (rest(0, 1) < 0.0) b.y() = -b.y();
  std::array<Eigen::Matrix3d, 2> rotations;
  for (int k = 0; k < 2; ++k) {
    Eigen::Matrix3d R;
    R.topLeftCorner<2, 2>() = R22;
    R.bottomLeftCorner<1, 2>() = (k == 0 ? 1.0 : -1.0) * b.transpose();
    R.col(2) = R.col(0).cross(R.col(1));
    rotations[static_cast<std::size_t>(k)] = Rv * R;
  }
  return rotations;
}

Eigen::Vector3d translation_for(const Eigen::Matrix3d& R, std::span<const Eigen::Vector3d> points,
                                std::span<const Eigen::Vector2d> image) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p = R * points[i];
    Eigen::Matrix<double, 2, 3> A;
    A << 1, 0, -image[i].x(), 0, 1, -image[i].y();
    normal += A.transpose() * A;
    right -= A.transpose() * A * p;
  }
  return solve_symmetric(normal, right);
}

struct Linearised {
  Matrix6d normal = Matrix6d::Zero();  // J'J / sigma^2
  Vector6d gradient = Vector6d::Zero();
  double chi_square = 0.0;
};

std::optional<Linearised> linearise(const CameraModel& camera, const Pose& T_camera_marker,
                                    std::span<const Eigen::Vector3d> points,
                                    std::span<const Eigen::Vector2d> pixels, double sigma_px) {
  Linearised out;
  const Eigen::Matrix3d R = T_camera_marker.matrix3();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto projection = project_with_derivatives(camera, T_camera_marker * points[i]);
    if (!projection) return std::nullopt;
    Eigen::Matrix<double, 3, 6> d_point;  // of T exp(d) p: R [-[p]x, I]
    d_point << -R * skew(points[i]), R;
    const Eigen::Matrix<double, 2, 6> J = projection->d_point * d_point / sigma_px;
    const Eigen::Vector2d r = (pixels[i] - projection->pixel) / sigma_px;
    out.normal += J.transpose() * J;
    out.gradient += J.transpose() * r;
    out.chi_square += r.squaredNorm();
  }
  return out;
}

struct Refined {
  PlanarBranch branch;
  bool converged = false;
};

// Levenberg-Marquardt on the corners.
std::optional<Refined> refine(const CameraModel& camera, Pose pose,
                              std::span<const Eigen::Vector3d> points,
                              std::span<const Eigen::Vector2d> pixels, double sigma_px) {
  auto state = linearise(camera, pose, points, pixels, sigma_px);
  if (!state) return std::nullopt;
  double damping = 1e-6;
  bool converged = false;
  for (int i = 0; i < kMaxIterations && !converged; ++i) {
    Matrix6d damped = state->normal;
    damped.diagonal() *= 1.0 + damping;
    const Vector6d step = solve_symmetric(damped, state->gradient);
    const Pose candidate = pose * exp_pose(step);
    const auto next = linearise(camera, candidate, points, pixels, sigma_px);
    if (!next || next->chi_square > state->chi_square) {
      damping *= 10.0;
      converged = damping > 1e6;
      continue;
    }
    const double gain = state->chi_square - next->chi_square;
    pose = candidate;
    state = next;
    damping = std::max(1e-12, damping * 0.1);
    converged = gain < 1e-9 * (1.0 + state->chi_square);
  }
  const std::optional<Matrix6d> covariance = inverse_of_positive(state->normal);
  if (!covariance || !covariance->allFinite()) return std::nullopt;
  return Refined{{pose, state->chi_square, *covariance}, converged};
}

// Halfway between two branches, where its translation fits best.
std::optional<PlanarBranch> between(const CameraModel& camera, const PlanarBranch& a,
                                    const PlanarBranch& b, std::span<const Eigen::Vector3d> points,
                                    std::span<const Eigen::Vector2d> pixels, double sigma_px) {
  constexpr int kSteps = 2;
  const Pose& from = a.T_camera_marker;
  const Pose& to = b.T_camera_marker;
  Pose pose{from.rotation.slerp(0.5, to.rotation), 0.5 * (from.translation + to.translation)};
  for (int k = 0; k <= kSteps; ++k) {
    const auto state = linearise(camera, pose, points, pixels, sigma_px);
    if (!state) return std::nullopt;
    if (k == kSteps) return PlanarBranch{pose, state->chi_square, Matrix6d::Identity()};
    const Eigen::Matrix3d normal = state->normal.bottomRightCorner<3, 3>();
    const Eigen::Vector3d gradient = state->gradient.tail<3>();
    pose.translation += pose.rotation * Eigen::Vector3d(solve_symmetric(normal, gradient));
  }
  return std::nullopt;
}

// Where the two branches nearly meet, the corners say less than they do near either one: the
// covariance is widened towards the middle, as far as that is likely, until it allows the middle
// as the corners do, but by no more than half the way to the other branch.
void widen_towards(const PlanarBranch& middle, PlanarBranch& branch) {
  const Vector6d d = log_pose(branch.T_camera_marker.inverse() * middle.T_camera_marker);
  const double claimed = d.dot(solve_symmetric(branch.covariance, d));
  const double rise = std::max(1.0, middle.chi_square - branch.chi_square);
  if (claimed <= rise) return;
  const double likelihood = std::exp(0.5 * (1.0 - rise));
  branch.covariance += likelihood * (1.0 / rise - 1.0 / claimed) * d * d.transpose();
}

}  // namespace

std::optional<PlanarPose> estimate_planar_pose(const CameraModel& camera,
                                               std::span<const Eigen::Vector3d> corners_m,
                                               std::span<const Eigen::Vector2d> corners_px,
                                               double sigma_px) {
  if (corners_m.size() < 4 || corners_m.size() != corners_px.size()) return std::nullopt;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : corners_m) centre += p / static_cast<double>(corners_m.size());
  double scale = 0.0;
  for (const Eigen::Vector3d& p : corners_m) scale = std::max(scale, (p - centre).norm());
  std::vector<Eigen::Vector2d> plane;
  std::vector<Eigen::Vector2d> image;
  for (std::size_t i = 0; i < corners_m.size(); ++i) {
    const auto ray = unproject(camera, corners_px[i]);
    if (!ray) return std::nullopt;
    plane.emplace_back((corners_m[i] - centre).head<2>() / scale);
    image.push_back(*ray);
  }
  const auto H = homography(plane, image);
  if (!H) return std::nullopt;
  const auto rotations = ippe_rotations(*H);
  if (!rotations) return std::nullopt;

  std::vector<PlanarBranch> branches;
  bool converged = true;
  for (const Eigen::Matrix3d& R : *rotations) {
    const Pose start{Eigen::Quaterniond(R).normalized(), translation_for(R, corners_m, image)};
    if (const auto refined = refine(camera, start, corners_m, corners_px, sigma_px)) {
      branches.push_back(refined->branch);
      converged = converged && refined->converged;
    }
  }
  if (branches.empty()) return std::nullopt;
  if (branches.size() == 1) return PlanarPose{branches[0], std::nullopt};
  if (branches[1].chi_square < branches[0].chi_square) std::swap(branches[0], branches[1]);
  if (angle_between(branches[0].T_camera_marker.rotation, branches[1].T_camera_marker.rotation) <
      kSameBranch) {
    return PlanarPose{branches[0], std::nullopt};
  }
  const auto middle = between(camera, branches[0], branches[1], corners_m, corners_px, sigma_px);
  if (!middle) return PlanarPose{branches[0], branches[1]};
  // On its way to the first branch, no branch of its own.
  if (!converged && middle->chi_square < branches[1].chi_square)
    return PlanarPose{branches[0], std::nullopt};
  for (PlanarBranch& branch : branches) widen_towards(*middle, branch);
  return PlanarPose{branches[0], branches[1]};
}

std::optional<PlanarBranch> pose_about(const CameraModel& camera,
                                       std::span<const Eigen::Vector3d> corners_m,
                                       std::span<const Eigen::Vector2d> corners_px, double sigma_px,
                                       const Pose& T_camera_marker) {
  const auto at = linearise(camera, T_camera_marker, corners_m, corners_px, sigma_px);
  if (!at) return std::nullopt;
  const std::optional<Matrix6d> covariance = inverse_of_positive(at->normal);
  if (!covariance || !covariance->allFinite()) return std::nullopt;
  const Vector6d step = *covariance * at->gradient;
  return PlanarBranch{T_camera_marker * exp_pose(step), at->chi_square - step.dot(at->gradient),
                      *covariance};
}

}  // namespace kinescope
