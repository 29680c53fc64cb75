// SPDX-License-Identifier: Apache-2.0
//
// Observed against predicted, for corners, poses and points.
#include "calib/bundle/corrected.h"

namespace kinescope::bundle {
namespace {

std::optional<SightingError> compare_corners(const Sighting& sighting, const Pose& T_camera_marker,
                                             const CameraModel& camera, const MarkerShape& shape) {
  const auto n = static_cast<Eigen::Index>(sighting.corners_px.size());
  SightingError error{Eigen::VectorXd(2 * n), Eigen::Matrix<double, Eigen::Dynamic, 6>(2 * n, 6),
                      Eigen::Matrix<double, Eigen::Dynamic, kMaxIntrinsics>(2 * n, kMaxIntrinsics)};
  const Eigen::Matrix3d R = T_camera_marker.matrix3();
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector3d p = shape.corner_m(sighting.geometry_m[static_cast<std::size_t>(i)]);
    const auto projection = project_with_derivatives(camera, T_camera_marker * p);
    if (!projection) return std::nullopt;
    Eigen::Matrix<double, 3, 6> d_point;
    d_point << -R * skew(p), R;
    error.residual.segment<2>(2 * i) =
        (sighting.corners_px[static_cast<std::size_t>(i)] - projection->pixel) / sighting.sigma;
    error.d_marker.middleRows<2>(2 * i) = -(projection->d_point * d_point) / sighting.sigma;
    error.d_intrinsics.middleRows<2>(2 * i) = -projection->d_intrinsics / sighting.sigma;
  }
  return error;
}

SightingError compare_pose(const Sighting& sighting, const Pose& T_camera_marker) {
  const Vector6d d = log_pose(T_camera_marker.inverse() * sighting.T_camera_marker);
  // log(exp(-e) exp(d)) = d - Jl^-1(d) e
  return {sighting.whitening * d, -sighting.whitening * inverse_right_jacobian(-d),
          Eigen::Matrix<double, Eigen::Dynamic, kMaxIntrinsics>::Zero(6, kMaxIntrinsics)};
}

SightingError compare_point(const Sighting& sighting, const Pose& T_camera_marker,
                            const Eigen::Vector3d& observed) {
  SightingError error{
      (observed - T_camera_marker.translation) / sighting.sigma,
      Eigen::Matrix<double, Eigen::Dynamic, 6>::Zero(3, 6),
      Eigen::Matrix<double, Eigen::Dynamic, kMaxIntrinsics>::Zero(3, kMaxIntrinsics)};
  error.d_marker.rightCols<3>() = -T_camera_marker.matrix3() / sighting.sigma;
  return error;
}

}  // namespace

int Sighting::dimension() const {
  switch (kind) {
    case MeasurementKind::kCorners:
      return 2 * static_cast<int>(corners_px.size());
    case MeasurementKind::kPose:
      return 6;
    case MeasurementKind::kPoint:
      return 3;
  }
  return 0;
}

std::optional<SightingError> compare(const Sighting& sighting, const Pose& T_camera_marker,
                                     const CameraModel& camera, const Eigen::Vector3d* target_m,
                                     const MarkerShape& shape) {
  switch (sighting.kind) {
    case MeasurementKind::kCorners:
      return compare_corners(sighting, T_camera_marker, camera, shape);
    case MeasurementKind::kPose:
      return compare_pose(sighting, T_camera_marker);
    case MeasurementKind::kPoint:
      return compare_point(sighting, T_camera_marker,
                           target_m != nullptr ? *target_m : sighting.position_m);
  }
  return std::nullopt;
}

std::optional<Eigen::VectorXd> residual_of(const Sighting& sighting, const Pose& T_camera_marker,
                                           const CameraModel& camera,
                                           const Eigen::Vector3d* target_m,
                                           const MarkerShape& shape) {
  if (sighting.kind != MeasurementKind::kCorners) {
    auto error = compare(sighting, T_camera_marker, camera, target_m, shape);
    if (!error) return std::nullopt;
    return std::move(error->residual);
  }
  Eigen::VectorXd out(sighting.dimension());
  for (std::size_t i = 0; i < sighting.corners_px.size(); ++i) {
    const auto pixel = project(camera, T_camera_marker * shape.corner_m(sighting.geometry_m[i]));
    if (!pixel) return std::nullopt;
    out.segment<2>(static_cast<Eigen::Index>(2 * i)) =
        (sighting.corners_px[i] - *pixel) / sighting.sigma;
  }
  return out;
}

std::optional<CorrectedError> corrected_error_of(const Spec& spec, const State& state,
                                                 const Readings& readings,
                                                 const Sighting& sighting) {
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
  if (sighting.target >= 0) {
    target = Eigen::Vector3d(state.targets[static_cast<std::size_t>(sighting.target)].data());
  }
  const std::vector<int> which = corrections_of(spec, sighting);
  std::vector<double> values;
  for (const int c : which) values.push_back(state.corrections[static_cast<std::size_t>(c)]);
  const CorrectedSighting corrected = sum_corrections(spec, sighting, which, values);
  const auto camera = static_cast<std::size_t>(sighting.camera);
  return corrected_error(
      spec, sighting, corrected, from_block(camera_block(state, sighting).data()),
      chain_of(spec, state, readings, sighting), rates_of(spec, state, readings, sighting),
      from_block(state.mounts[static_cast<std::size_t>(sighting.marker)].data()),
      camera_of(spec, state, camera), sighting.target >= 0 ? &target : nullptr);
}

std::optional<SightingError> error_of(const Spec& spec, const State& state,
                                      const Readings& readings, const Sighting& sighting) {
  auto at = corrected_error_of(spec, state, readings, sighting);
  if (!at) return std::nullopt;
  return std::move(at->error);
}

}  // namespace kinescope::bundle
