// SPDX-License-Identifier: Apache-2.0
#include "app/explain/changed_evidence.h"

#include <utility>

namespace kinescope {

ChangedEvidence with_log(const Evidence& evidence, JointLog log) {
  ChangedEvidence out{evidence.recording, evidence.observed, evidence.tracks, evidence.camera};
  out.recording.log = std::move(log);
  return out;
}

ChangedEvidence without_sightings(const Evidence& evidence, JointLog log,
                                  const std::function<bool(TagId, int)>& is_aside) {
  ChangedEvidence out = with_log(evidence, std::move(log));
  Measurements& measured = out.observed.measurements;
  const auto is_seen_aside = [&](const auto& seen) { return is_aside(seen.id, seen.frame); };
  std::erase_if(measured.corners, is_seen_aside);
  std::erase_if(measured.points.observations, is_seen_aside);
  for (PoseTracks* tracks : {&measured.poses, &out.tracks}) {
    for (PoseTrack& track : tracks->tracks) {
      std::erase_if(track.samples,
                    [&](const PoseSample& sample) { return is_aside(track.id, sample.frame); });
    }
  }
  return out;
}

ChangedEvidence with_stamps(const Evidence& evidence, const std::vector<double>& times_s) {
  ChangedEvidence out = with_log(evidence, evidence.recording.log);
  Measurements& measured = out.observed.measurements;
  for (std::vector<double>* stamps :
       {&measured.times_s, &measured.poses.times_s, &measured.points.times_s,
        &out.observed.tags.times_s, &out.tracks.times_s}) {
    if (stamps->size() == times_s.size()) *stamps = times_s;
  }
  return out;
}

}  // namespace kinescope
