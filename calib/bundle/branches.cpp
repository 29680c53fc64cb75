// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/branches.h"

#include <algorithm>
#include <utility>

#include "calib/bundle/links_in_camera.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

void take_other(PoseSample& sample) {
  std::swap(sample.T_camera_marker, value_of(sample.T_camera_marker_alternative));
  if (sample.alternative_covariance) std::swap(sample.covariance, *sample.alternative_covariance);
  sample.alternative_cost = -sample.alternative_cost;
}

}  // namespace

PoseTracks with_branches_of(const Calibration& calibration, PoseTracks tracks) {
  if (calibration.status != CalibrationStatus::kConverged) return tracks;
  const auto links = bundle::links_in_camera(calibration);
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
