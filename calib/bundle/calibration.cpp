// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/calibration.h"

#include <cmath>

namespace kinescope {

std::string_view to_string(CalibrationStatus status) {
  switch (status) {
    case CalibrationStatus::kNotRun:
      return "not_run";
    case CalibrationStatus::kConverged:
      return "converged";
    case CalibrationStatus::kNotConverged:
      return "not_converged";
    case CalibrationStatus::kUndetermined:
      return "undetermined";
  }
  return "unknown";
}

namespace {

// Of distances between corners, px; or between points, m.
struct DistanceRms {
  double squares = 0.0;
  int count = 0;
  void add(MeasurementKind kind, const std::vector<Eigen::Vector2d>& corners_px,
           const Vector6d& displacement) {
    if (kind == MeasurementKind::kCorners) {
      for (const Eigen::Vector2d& corner : corners_px) squares += corner.squaredNorm();
      count += static_cast<int>(corners_px.size());
      return;
    }
    if (displacement.isZero(0.0)) return;  // nothing was predicted
    squares += displacement.tail<3>().squaredNorm();
    ++count;
  }
  [[nodiscard]] double value() const { return count > 0 ? std::sqrt(squares / count) : 0.0; }
};

}  // namespace

Pose camera_from_base(const Calibration& calibration, int frame,
                      const std::vector<Pose>& T_base_link) {
  if (!calibration.moving) return calibration.T_camera_base_of(calibration.camera_at(frame));
  const MovingCamera& moving = *calibration.moving;
  if (!moving.on_robot()) return moving.path[static_cast<std::size_t>(frame)];
  return moving.T_camera_link * T_base_link[moving.link.index()].inverse();
}

std::vector<CameraErrors> errors_of_cameras(const Calibration& calibration) {
  std::vector<CameraErrors> out(calibration.cameras());
  std::vector<DistanceRms> fitted(out.size());
  std::vector<DistanceRms> held_out(out.size());
  for (const SightingResidual& sighting : calibration.residuals) {
    const std::size_t c = calibration.camera_at(sighting.frame);
    ++(sighting.used ? out[c].used : out[c].rejected);
    if (!sighting.used) continue;
    fitted[c].add(calibration.kind, sighting.corners_px, sighting.displacement);
    held_out[c].add(calibration.kind, sighting.held_out_px, sighting.held_out_displacement);
  }
  for (std::size_t c = 0; c < out.size(); ++c) {
    out[c].final_rms = fitted[c].value();
    out[c].held_out_rms = held_out[c].value();
  }
  return out;
}

}  // namespace kinescope
