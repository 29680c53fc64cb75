// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/undone.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

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

/// A sighting that the calibration used: where the robot without effects has the marker, and what
/// the sighting leaves of the model with them.
struct UsedSighting {
  Pose T_camera_marker;
  const SightingResidual* residual = nullptr;
};

class UsedSightings {
 public:
  /// `calibration` must outlive it.
  explicit UsedSightings(const Calibration& calibration)
      : calibration_(calibration), links_(bundle::links_in_camera(calibration)) {
    for (const SightingResidual& residual : calibration.residuals)
      residuals_[{residual.frame, residual.id}] = &residual;
  }

  [[nodiscard]] std::optional<UsedSighting> find(int frame, const Marker& marker) const {
    const auto residual = residuals_.find({frame, marker.id});
    if (residual == residuals_.end() || !residual->second->used) return std::nullopt;
    const std::vector<Pose>& links = links_[static_cast<std::size_t>(frame)];
    if (links.empty()) return std::nullopt;
    const Pose T_camera_marker = links[marker.link.index()] * marker.T_link_marker;
    if (calibration_.camera_at(frame) == 0) return UsedSighting{T_camera_marker, residual->second};
    // Each camera's corners are seen from where that camera is.
    const Pose T_own_reference = calibration_.T_camera_base_of(calibration_.camera_at(frame)) *
                                 calibration_.T_camera_base.inverse();
    return UsedSighting{T_own_reference * T_camera_marker, residual->second};
  }

 private:
  const Calibration& calibration_;
  std::map<std::pair<int, TagId>, const SightingResidual*> residuals_;
  std::vector<std::vector<Pose>> links_;  // by frame
};

// Where the camera would see the corners, with what is left of each; nothing where one lies behind
// it.
std::optional<std::vector<Eigen::Vector2d>> seen(const CameraModel& camera,
                                                 const Pose& T_camera_marker,
                                                 const std::vector<Eigen::Vector3d>& corners_m,
                                                 const std::vector<Eigen::Vector2d>& left_px) {
  std::vector<Eigen::Vector2d> out;
  for (std::size_t i = 0; i < corners_m.size(); ++i) {
    const std::optional<Eigen::Vector2d> at = project(camera, T_camera_marker * corners_m[i]);
    if (!at) return std::nullopt;
    out.push_back(*at + left_px[i]);
  }
  return out;
}

}  // namespace

PoseTracks with_effects_undone(const Calibration& calibration, PoseTracks tracks) {
  const UsedSightings used(calibration);
  for (PoseTrack& track : tracks.tracks) {
    const Marker* marker = calibration.tree.marker(track.id);
    if (marker == nullptr) continue;
    std::vector<PoseSample> undone;
    for (PoseSample& sample : track.samples) {
      const auto sighting = used.find(sample.frame, *marker);
      if (!sighting) continue;
      const Pose undone_pose =
          displaced(sighting->T_camera_marker, sighting->residual->displacement, calibration.kind);
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

TagObservations with_effects_undone(const Calibration& calibration, const MarkerSet& markers,
                                    TagObservations tags) {
  const UsedSightings used(calibration);
  std::vector<TagObservation> undone;
  for (TagObservation& tag : tags.observations) {
    const Marker* marker = calibration.tree.marker(tag.id);
    if (marker == nullptr) {
      undone.push_back(std::move(tag));
      continue;
    }
    const auto sighting = used.find(tag.frame, *marker);
    if (!sighting) continue;
    auto corners_px =
        seen(calibration.model_of_camera(calibration.camera_at(tag.frame)),
             sighting->T_camera_marker, markers.corners_m(tag.id), sighting->residual->corners_px);
    if (!corners_px) continue;
    tag.corners_px = std::move(*corners_px);
    undone.push_back(std::move(tag));
  }
  tags.observations = std::move(undone);
  return tags;
}

}  // namespace kinescope
