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

// Of distances between corners, px.
struct CornerRms {
  double squares = 0.0;
  int count = 0;
  void add(const std::vector<Eigen::Vector2d>& corners_px) {
    for (const Eigen::Vector2d& corner : corners_px) squares += corner.squaredNorm();
    count += static_cast<int>(corners_px.size());
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
  std::vector<CornerRms> fitted(out.size());
  std::vector<CornerRms> held_out(out.size());
  for (const SightingResidual& sighting : calibration.residuals) {
    const std::size_t c = calibration.camera_at(sighting.frame);
    ++(sighting.used ? out[c].used : out[c].rejected);
    if (!sighting.used) continue;
    fitted[c].add(sighting.corners_px);
    held_out[c].add(sighting.held_out_px);
  }
  for (std::size_t c = 0; c < out.size(); ++c) {
    out[c].final_px = fitted[c].value();
    out[c].held_out_px = held_out[c].value();
  }
  return out;
}

}  // namespace kinescope
