// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/shown_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "calib/tracks/planar_pose.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/student_t.h"

namespace kinescope {
namespace {

// Of each marker: noise of 0.03 px is known to a tenth, and a clean recording takes 20 ms more.
constexpr std::size_t kMostViewsOfOne = 100;
constexpr double kLeftOfASquare = 2.0;  // coordinates: eight less the six of its pose
constexpr double kLeastScale = 1e-12;   // of the declared noise, squared
constexpr int kShapeNumbers = 3;        // width, shear, warp

using Views = std::vector<const TagObservation*>;
using ShapeNormal = Eigen::Matrix3d;
using ShapeVector = Eigen::Vector3d;

MarkerShape shape_of_numbers(const ShapeVector& numbers) {
  return {1.0, numbers[0], numbers[1], numbers[2]};
}

std::vector<Eigen::Vector3d> shaped(const std::vector<Eigen::Vector3d>& square,
                                    const MarkerShape& shape) {
  std::vector<Eigen::Vector3d> out;
  for (const Eigen::Vector3d& corner : square) out.push_back(shape.corner_m(corner));
  return out;
}

// Spread evenly over each marker's views.
std::map<TagId, Views> views_by_marker(const TagObservations& observations,
                                       const MarkerSet& markers) {
  std::map<TagId, Views> all;
  for (const TagObservation& seen : observations.observations) {
    if (!markers.boards.contains(seen.id) && markers.size_m(seen.id) > 0.0)
      all[seen.id].push_back(&seen);
  }
  for (auto& [id, views] : all) {
    const std::size_t count = std::min(views.size(), kMostViewsOfOne);
    for (std::size_t k = 0; k < count; ++k) views[k] = views[k * views.size() / count];
    views.resize(count);
  }
  return all;
}

// Of one view by the shape, in standard deviations: what its pose leaves.
struct Left {
  ShapeNormal normal = ShapeNormal::Zero();
  ShapeVector gradient = ShapeVector::Zero();
  double chi_square = 0.0;
};

std::optional<Left> left_of(const CameraModel& camera, const TagObservation& view,
                            const std::vector<Eigen::Vector3d>& square, const MarkerShape& shape) {
  const std::vector<Eigen::Vector3d> corners_m = shaped(square, shape);
  const auto pose = estimate_planar_pose(camera, corners_m, view.corners_px, view.sigma_px);
  if (!pose) return std::nullopt;
  const Pose& T = pose->best.T_camera_marker;
  const Eigen::Matrix3d R = T.matrix3();
  constexpr int kRows = 8;
  Eigen::Matrix<double, kRows, 1> r;
  Eigen::Matrix<double, kRows, 6> by_pose;
  Eigen::Matrix<double, kRows, kShapeNumbers> by_shape;
  for (int i = 0; i < kRows / 2; ++i) {
    const auto c = static_cast<std::size_t>(i);
    const auto at = project_with_derivatives(camera, T * corners_m[c]);
    if (!at) return std::nullopt;
    const Eigen::Matrix<double, 2, 3> d_point = at->d_point * R / view.sigma_px;
    r.segment<2>(2 * i) = (view.corners_px[c] - at->pixel) / view.sigma_px;
    by_pose.middleRows<2>(2 * i) << -d_point * skew(corners_m[c]), d_point;
    for (int k = 0; k < kShapeNumbers; ++k) {
      MarkerShape unit = shape_of_numbers(ShapeVector::Unit(k));
      unit.size = 0.0;
      by_shape.block<2, 1>(2 * i, k) = d_point * unit.corner_m(square[c]);
    }
  }
  const Matrix6d pose_normal = by_pose.transpose() * by_pose;
  for (int k = 0; k < kShapeNumbers; ++k) {
    const Vector6d pose_gradient = by_pose.transpose() * by_shape.col(k);
    by_shape.col(k) -= by_pose * solve_symmetric(pose_normal, pose_gradient);
  }
  return Left{by_shape.transpose() * by_shape, by_shape.transpose() * r, r.squaredNorm()};
}

// Nothing for views that no pose fits.
std::vector<std::optional<Left>> left_of_all(const CameraModel& camera, const Views& views,
                                             const std::vector<Eigen::Vector3d>& square,
                                             const MarkerShape& shape) {
  std::vector<std::optional<Left>> out;
  for (const TagObservation* view : views) out.push_back(left_of(camera, *view, square, shape));
  return out;
}

std::vector<double> chi_squares(const std::vector<std::optional<Left>>& left) {
  std::vector<double> out;
  for (const auto& of : left)
    if (of) out.push_back(of->chi_square);
  return out;
}

// What printed markers are like, one standard deviation: where the views say less (those of a
// marker at rest), that is what counts.
ShapeVector prior_sigma(double half_edge_m) {
  constexpr double kOffSquare = 0.02;
  constexpr double kWarp = 0.1;  // of half the edge
  return {kOffSquare, kOffSquare, kWarp * half_edge_m};
}

std::optional<ShapeVector> step_from(const std::vector<std::optional<Left>>& left,
                                     const ShapeVector& numbers, const ShapeVector& sigma) {
  const double scale = fit_student_t(chi_squares(left), kLeftOfASquare, kLeastScale).scale_squared;
  const ShapeVector weights = sigma.cwiseProduct(sigma).cwiseInverse();
  ShapeNormal normal = weights.asDiagonal();
  ShapeVector gradient = -weights.cwiseProduct(numbers);
  for (const auto& of : left) {
    if (!of) continue;
    const double weight = student_weight(of->chi_square, kLeftOfASquare, scale);
    normal += weight * of->normal;
    gradient += weight * of->gradient;
  }
  ShapeVector step = solve_symmetric(normal, gradient);
  if (!step.allFinite()) return std::nullopt;
  return step;
}

// Where the views have the shape when it is looked for near a warp.
std::optional<ShapeVector> shape_near(const CameraModel& camera, const Views& views,
                                      const std::vector<Eigen::Vector3d>& square, double warp_m,
                                      const ShapeVector& sigma) {
  constexpr int kSteps = 5;
  ShapeVector numbers(0.0, 0.0, warp_m);
  for (int k = 0; k < kSteps; ++k) {
    const std::optional<ShapeVector> step =
        step_from(left_of_all(camera, views, square, shape_of_numbers(numbers)), numbers, sigma);
    if (!step) return std::nullopt;
    numbers += *step;
  }
  return numbers;
}

// Deviance of a square less that of a shape, over the views that either has a pose for.
double gain_of(const std::vector<std::optional<Left>>& square,
               const std::vector<std::optional<Left>>& shape) {
  std::vector<double> of_square, of_shape;
  for (std::size_t v = 0; v < square.size(); ++v) {
    if (!square[v] || !shape[v]) continue;
    of_square.push_back(square[v]->chi_square);
    of_shape.push_back(shape[v]->chi_square);
  }
  return fit_student_t(of_square, kLeftOfASquare, kLeastScale).deviance -
         fit_student_t(of_shape, kLeftOfASquare, kLeastScale).deviance;
}

std::optional<ShownShape> shown_shape(const CameraModel& camera, TagId id, const Views& views,
                                      const std::vector<Eigen::Vector3d>& square) {
  // Of half the edge. A bent marker seen from before has its planar branches exchanged in views
  // that a small warp leaves so: a start on either side, as far as paper on a link is bent.
  constexpr std::array kStarts{0.0, -0.1, 0.1};
  if (views.size() <= kShapeNumbers) return std::nullopt;
  const double half = square.front().head<2>().cwiseAbs().maxCoeff();
  const ShapeVector sigma = prior_sigma(half);
  const auto flat = left_of_all(camera, views, square, {});
  const double cost = kShapeNumbers * std::log(static_cast<double>(views.size()));
  std::optional<ShownShape> best;
  for (const double start : kStarts) {
    const auto numbers = shape_near(camera, views, square, start * half, sigma);
    if (!numbers) continue;
    const MarkerShape shape = shape_of_numbers(*numbers);
    const double unlike = numbers->cwiseQuotient(sigma).squaredNorm();
    const double gain = gain_of(flat, left_of_all(camera, views, square, shape));
    const double odds = 0.5 * (gain - cost - unlike);
    if (!best || odds > best->log_odds) best = ShownShape{id, shape, odds};
  }
  return best;
}

}  // namespace

std::vector<ShownShape> shown_shapes(const CameraModel& camera, const TagObservations& observations,
                                     const MarkerSet& markers) {
  std::vector<ShownShape> out;
  for (const auto& [id, views] : views_by_marker(observations, markers)) {
    if (const auto shown = shown_shape(camera, id, views, markers.corners_m(id)))
      out.push_back(*shown);
  }
  return out;
}

double scale_of_shapes(const CameraModel& camera, const TagObservations& observations,
                       const MarkerSet& markers) {
  std::vector<double> squares;  // px^2
  for (const auto& [id, views] : views_by_marker(observations, markers)) {
    for (const TagObservation* view : views) {
      const auto pose =
          estimate_planar_pose(camera, markers.corners_m(id), view->corners_px, view->sigma_px);
      if (pose) squares.push_back(pose->best.chi_square * view->sigma_px * view->sigma_px);
    }
  }
  return std::sqrt(fit_student_t(squares, kLeftOfASquare, kLeastScale).scale_squared);
}

}  // namespace kinescope
