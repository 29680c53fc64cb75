// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/branches.h"

#include <algorithm>
#include <utility>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// Links in the camera's frame, one list a frame; empty where a joint value is unknown.
std::vector<std::vector<Pose>> links_in_camera(const Calibration& calibration) {
  std::vector<std::vector<Pose>> out;
  for (Eigen::Index f = 0; f < calibration.joint_values.rows(); ++f) {
    std::vector<Pose>& links = out.emplace_back();
    const Eigen::VectorXd q = calibration.joint_values.row(f);
    if (!q.allFinite()) continue;
    links = forward_kinematics(calibration.tree, q);
    for (Pose& link : links) link = calibration.T_camera_base * link;
  }
  return out;
}

void take_other(PoseSample& sample) {
  std::swap(sample.T_camera_marker, value_of(sample.T_camera_marker_alternative));
  if (sample.alternative_covariance) std::swap(sample.covariance, *sample.alternative_covariance);
  sample.alternative_cost = -sample.alternative_cost;
}

}  // namespace

PoseTracks with_branches_of(const Calibration& calibration, PoseTracks tracks) {
  if (calibration.status != CalibrationStatus::kConverged) return tracks;
  const auto links = links_in_camera(calibration);
  for (PoseTrack& track : tracks.tracks) {
    const auto marker = std::ranges::find(calibration.tree.markers, track.id, &Marker::id);
    if (marker == calibration.tree.markers.end()) continue;
    for (PoseSample& sample : track.samples) {
      const auto frame = static_cast<std::size_t>(sample.frame);
      if (!sample.T_camera_marker_alternative || frame >= links.size() || links[frame].empty())
        continue;
      const Eigen::Quaterniond model =
          links[frame][marker->link.index()].rotation * marker->T_link_marker.rotation;
      if (angle_between(sample.T_camera_marker_alternative->rotation, model) <
          angle_between(sample.T_camera_marker.rotation, model)) {
        take_other(sample);
      }
    }
  }
  return tracks;
}

}  // namespace kinescope
