// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/structure.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/error.h"
#include "kinematics/structure/assemble.h"
#include "kinematics/structure/readings.h"
#include "kinematics/structure/search.h"
#include "kinematics/structure/series.h"
#include "kinematics/structure/verdict.h"

namespace kinescope {
namespace {

using namespace structure_search;  // NOLINT(google-build-using-namespace): this file is its front
                                   // door

// Instants the search looks at; averages of the frames around them.
constexpr int kInstants = 240;
// A body has to be seen this often to take part.
constexpr int kFewestSightings = 8;

void check(const PoseTracks& tracks) {
  for (std::size_t f = 1; f < tracks.times_s.size(); ++f) {
    KINESCOPE_CHECK(tracks.times_s[f] > tracks.times_s[f - 1], "frame times increase");
  }
}

PoseTracks without_rare(const PoseTracks& tracks) {
  PoseTracks out = tracks;
  std::erase_if(out.tracks, [](const PoseTrack& t) { return t.samples.size() < kFewestSightings; });
  return out;
}

Structure nothing(StructureDoubt doubt) {
  Structure out;
  out.status = StructureStatus::kUndetermined;
  out.links.resize(1);
  out.doubts.push_back(std::move(doubt));
  return out;
}

}  // namespace

std::string_view to_string(StructureStatus status) {
  switch (status) {
    case StructureStatus::kNotRun:
      return "not_run";
    case StructureStatus::kDetermined:
      return "determined";
    case StructureStatus::kAmbiguous:
      return "ambiguous";
    case StructureStatus::kUndetermined:
      return "undetermined";
  }
  return "unknown";
}

Structure find_structure(const PoseTracks& tracks, const JointLog& log,
                         const StructureOptions& options) {
  check(tracks);
  const PoseTracks seen = without_rare(tracks);
  if (seen.tracks.empty()) {
    return nothing(
        {"no marker was seen often enough", "record with the markers in view of the camera", {}});
  }
  const Series full = clean_series(seen);
  const Series thin = thinned(full, kInstants);
  const Readings overlap = readings_at(log, thin, 0.0, options.max_gap_s);
  if (!log.channels.empty() && std::ranges::count(overlap.valid, 1) < kFewestSightings) {
    return nothing({"the joint log and the frames share no time",
                    "check that both clocks start together, or give the offset between them",
                    {}});
  }
  const FoundTree s = search_tree(full, thin, log, options);
  const Verdict verdict = judge(s.tree, thin, s.readings, log, options);
  const Readings every = readings_like(s.readings, log, full, s.offset.value_s, options.max_gap_s);
  const GrownTree fitted = refit_tree(s.tree, full, every);
  Structure out = assemble(fitted, full, every, verdict);
  out.time_offset_s = s.offset.value_s;
  out.time_offset_sigma_s = s.offset.sigma_s;
  for (const PoseTrack& t : tracks.tracks) {
    if (t.samples.size() < kFewestSightings) {
      out.doubts.push_back(
          {"tag " + std::to_string(t.id.value) + " is seen too rarely to be placed",
           "keep it in view for longer",
           {"tag_" + std::to_string(t.id.value)}});
    }
  }
  return out;
}

}  // namespace kinescope
