// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/structure.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "kinematics/core/error.h"
#include "kinematics/structure/assemble.h"
#include "kinematics/structure/doubts.h"
#include "kinematics/structure/move_bodies.h"

namespace kinescope {
namespace {

using namespace structure_search;  // NOLINT(google-build-using-namespace): this file is its front
                                   // door

// A body has to be seen this often to take part.
constexpr int kFewestSightings = 8;

void check(const PoseTracks& tracks) {
  for (std::size_t f = 1; f < tracks.times_s.size(); ++f) {
    KINESCOPE_CHECK(tracks.times_s[f] > tracks.times_s[f - 1], "frame times increase");
  }
}

bool is_rare(const PoseTrack& track) { return track.samples.size() < kFewestSightings; }

PoseTracks without_rare(const PoseTracks& tracks) {
  PoseTracks out = tracks;
  std::erase_if(out.tracks, is_rare);
  return out;
}

// Markers that took no part.
void doubt_rare(const PoseTracks& tracks, Structure& out) {
  for (const PoseTrack& t : tracks.tracks) {
    if (!is_rare(t)) continue;
    const std::string id = std::to_string(t.id.value);
    out.doubts.push_back({"tag " + id + " is seen too rarely to be placed",
                          "keep it in view for longer",
                          {"tag_" + id}});
  }
}

Structure nothing(StructureDoubt doubt) {
  Structure out;
  out.status = StructureStatus::kUndetermined;
  out.links.resize(1);
  out.doubts.push_back(std::move(doubt));
  return out;
}

// The tree with one body hung elsewhere.
GrownTree with_place(const Answer& answer, const RivalPlace& rival) {
  GrowthState state = continued_growth(answer.found.tree, answer.thin, answer.found.readings, {});
  move_body(state, rival.body, rival.attachment);
  return std::move(state.tree);
}

// On every frame.
struct EveryFrame {
  const Series& series;
  const Readings& readings;
  double time_offset_s;
};

Structure assembled(const GrownTree& fitted, const EveryFrame& every, const Verdict& verdict) {
  Structure out = assemble(fitted, every.series, every.readings, verdict);
  out.time_offset_s = every.time_offset_s;
  return out;
}

std::vector<RivalStructure> rivals_of(const Answer& answer, const EveryFrame& every,
                                      const std::vector<RivalPlace>& rivals) {
  std::vector<RivalStructure> out;
  for (const RivalPlace& rival : rivals) {
    const GrownTree tree = refit_tree(with_place(answer, rival), every.series, every.readings);
    Verdict unknown;
    unknown.status = StructureStatus::kDetermined;
    unknown.link_log_odds.resize(tree.links.size());
    unknown.link_runner_up.resize(tree.links.size());
    out.push_back({rival.words, rival.instead_of, assembled(tree, every, unknown)});
  }
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
  Series clean = clean_series(seen);
  const Series plain = thinned(clean, kInstants);
  const Readings overlap = readings_at(log, plain, 0.0, options.max_gap_s);
  if (!log.channels.empty() && std::ranges::count(overlap.valid, 1) < kFewestSightings) {
    return nothing({"the joint log and the frames share no time",
                    "check that both clocks start together, or give the offset between them",
                    {}});
  }
  OwnLog own;
  const Answer answer = find_answer(std::move(clean), log, options, own);
  const FoundTree& s = answer.found;
  const Series& full = answer.full;
  const Verdict verdict = judge(s.tree, answer.thin, s.readings, own.log, options);
  const Readings every =
      readings_like(s.readings, own.log, full, s.offset.value_s, options.max_gap_s);
  const GrownTree fitted = refit_tree(s.tree, full, every);
  const EveryFrame frames{full, every, s.offset.value_s};
  Structure out = assembled(fitted, frames, verdict);
  out.rivals = rivals_of(answer, frames, verdict.rivals);
  if (used_channels(fitted) > 0) doubt_unpaired(every, own, out);
  in_whole_log(own, log, out);
  for (RivalStructure& rival : out.rivals) in_whole_log(own, log, rival.structure);
  doubt_shared_channels(log, out);
  doubt_copies(log, out);
  doubt_allowance(answer, out);
  judge_fit(answer, plain, log, own, options, out);
  doubt_clocks(fitted, every, full, own.log, options, out);
  out.time_offset_sigma_s = s.offset.sigma_s;
  doubt_rare(tracks, out);
  return out;
}

Structure with_rival(const Structure& structure, std::size_t rival, const JointLog& log) {
  Structure out = structure.rivals[rival].structure;
  out.status = StructureStatus::kDetermined;
  out.copied_channels = structure.copied_channels;
  out.time_offset_sigma_s = structure.time_offset_sigma_s;
  std::ranges::copy_if(
      structure.doubts, std::back_inserter(out.doubts),
      [](const StructureDoubt& doubt) { return !doubt.of_model && !doubt.of_rivals; });
  structure_search::doubt_shared_channels(log, out);
  out.rivals = structure.rivals;
  RivalStructure& before = out.rivals[rival];
  std::swap(before.words, before.instead_of);
  before.structure = structure;
  before.structure.rivals.clear();
  return out;
}

Structure with_rivals_judged(Structure structure, const std::vector<double>& log_odds) {
  KINESCOPE_CHECK(log_odds.size() == structure.rivals.size(), "odds against every rival");
  if (log_odds.empty()) return structure;
  double odds = 0.0;
  double most = 1.0;
  for (const double against : log_odds) odds += std::exp(-against);
  for (StructureJoint& joint : structure.joints) {
    most = std::min(most, 1.0 - joint.unexplained);
    const auto rival = std::ranges::find(structure.rivals, joint.runner_up, &RivalStructure::words);
    if (rival != structure.rivals.end())
      joint.log_odds = log_odds[static_cast<std::size_t>(rival - structure.rivals.begin())];
  }
  const auto closest = std::ranges::min_element(log_odds);
  structure.runner_up =
      structure.rivals[static_cast<std::size_t>(closest - log_odds.begin())].words;
  structure.runner_up_log_odds = *closest;
  structure.probability = std::min(most, 1.0 / (1.0 + odds));
  std::erase_if(structure.doubts, [](const StructureDoubt& doubt) { return doubt.of_rivals; });
  if (*closest < StructureOptions{}.min_log_odds) {
    structure.status = StructureStatus::kAmbiguous;
    structure.doubts.push_back(rival_doubt(structure.runner_up));
  } else {
    structure.status = StructureStatus::kDetermined;
  }
  structure.rivals.clear();
  return structure;
}

}  // namespace kinescope
