// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/merged_bodies.h"

#include <algorithm>

#include "calib/tracks/tracks_from_base.h"
#include "kinematics/structure/rigid_bodies.h"

namespace kinescope {
namespace {

PoseTrack track_of(const BaseView& body) {
  PoseTrack out{body.markers.front(), {}};
  for (std::size_t f = 0; f < body.cameras.size(); ++f) {
    if (!body.cameras[f]) continue;
    PoseSample& sample = out.samples.emplace_back();
    sample.frame = static_cast<int>(f);
    sample.T_camera_marker = body.cameras[f]->T_camera_base;
    sample.covariance = body.cameras[f]->covariance;
  }
  return out;
}

void put_back(const MergedBody& body, Structure& structure) {
  for (StructureLink& link : structure.links) {
    const auto first = std::ranges::find(link.markers, body.markers.front());
    if (first == link.markers.end()) continue;
    const Pose T_reference_first =
        link.T_reference_marker[static_cast<std::size_t>(first - link.markers.begin())];
    // Behind the first one, which may be the link's reference, since ids increase.
    for (std::size_t k = 1; k < body.markers.size(); ++k) {
      const auto at =
          std::ranges::upper_bound(link.markers, body.markers[k]) - link.markers.begin();
      link.markers.insert(link.markers.begin() + at, body.markers[k]);
      link.T_reference_marker.insert(link.T_reference_marker.begin() + at,
                                     T_reference_first * body.T_first_marker[k]);
    }
    return;
  }
  std::vector<TagId>& free = structure.free_markers;
  if (std::ranges::find(free, body.markers.front()) == free.end()) return;
  free.insert(free.end(), body.markers.begin() + 1, body.markers.end());
  std::ranges::sort(free);
}

}  // namespace

MergedBodies merge_rigid_bodies(const PoseTracks& tracks) {
  MergedBodies out;
  out.tracks = tracks;
  for (const std::vector<TagId>& markers : rigid_bodies(tracks)) {
    if (markers.size() < 2) continue;
    const BaseView body = tracks_from_base(tracks, markers);
    std::erase_if(out.tracks.tracks, [&](const PoseTrack& track) {
      return std::ranges::find(markers, track.id) != markers.end();
    });
    out.tracks.tracks.push_back(track_of(body));
    out.bodies.push_back({body.markers, body.T_base_marker});
  }
  std::ranges::sort(out.tracks.tracks, {}, &PoseTrack::id);
  return out;
}

void put_back(const std::vector<MergedBody>& bodies, Structure& structure) {
  for (const MergedBody& body : bodies) put_back(body, structure);
}

}  // namespace kinescope
