// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/undone.h"

#include <algorithm>
#include <map>
#include <utility>

#include "calib/bundle/links_in_camera.h"

namespace kinescope {
namespace {

// Of corners the displacement is given in the camera's axes, else in the marker's.
Pose displaced(const Pose& T_camera_marker, Vector6d displacement, MeasurementKind kind) {
  if (kind == MeasurementKind::kCorners) {
    const Eigen::Matrix3d R = T_camera_marker.matrix3().transpose();
    displacement.head<3>() = R * displacement.head<3>();
    displacement.tail<3>() = R * displacement.tail<3>();
  }
  return T_camera_marker * exp_pose(displacement);
}

// The camera sees a marker as uncertain along its line of sight as before, however it is turned
// now.
Matrix6d turned(const Matrix6d& covariance, const Eigen::Matrix3d& R_now_before) {
  Matrix6d R = Matrix6d::Zero();
  R.topLeftCorner<3, 3>() = R_now_before;
  R.bottomRightCorner<3, 3>() = R_now_before;
  return R * covariance * R.transpose();
}

}  // namespace

PoseTracks with_effects_undone(const Calibration& calibration, PoseTracks tracks) {
  std::map<std::pair<int, TagId>, const SightingResidual*> residuals;
  for (const SightingResidual& residual : calibration.residuals)
    residuals[{residual.frame, residual.id}] = &residual;
  const auto links = bundle::links_in_camera(calibration);
  for (PoseTrack& track : tracks.tracks) {
    const Marker* marker = calibration.tree.marker(track.id);
    if (marker == nullptr) continue;
    std::vector<PoseSample> undone;
    for (PoseSample& sample : track.samples) {
      const auto residual = residuals.find({sample.frame, track.id});
      const auto frame = static_cast<std::size_t>(sample.frame);
      if (residual == residuals.end() || !residual->second->used || links[frame].empty()) continue;
      const Pose undone_pose = displaced(links[frame][marker->link.index()] * marker->T_link_marker,
                                         residual->second->displacement, calibration.kind);
      if (calibration.kind == MeasurementKind::kCorners) {
        sample.covariance = turned(sample.covariance, undone_pose.matrix3().transpose() *
                                                          sample.T_camera_marker.matrix3());
      }
      sample.T_camera_marker = undone_pose;
      sample.T_camera_marker_alternative.reset();
      undone.push_back(std::move(sample));
    }
    track.samples = std::move(undone);
  }
  return tracks;
}

}  // namespace kinescope
