// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/structure.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/error.h"
#include "kinematics/structure/assemble.h"
#include "kinematics/structure/growth.h"
#include "kinematics/structure/readings.h"
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
// A time offset that moved by more than this (s) after the scan is worth a second search.
constexpr double kOffsetMoved = 0.03;

void check(const PoseTracks& tracks) {
  for (std::size_t f = 1; f < tracks.times_s.size(); ++f) {
    KINESCOPE_CHECK(tracks.times_s[f] > tracks.times_s[f - 1], "frame times increase");
  }
}

struct TimeOffset {
  double value_s = 0.0;
  double sigma_s = 0.0;
};

// The offset at which the tree as a whole fits best: parabolas through three refits, ever narrower.
TimeOffset refine_offset(GrownTree& tree, const Series& series, const JointLog& log,
                         const Readings& like, double start_s, const StructureOptions& options) {
  TimeOffset offset{start_s, 0.0};
  const auto cost_at = [&](double value_s) {
    const Readings r = readings_like(like, log, series, value_s, options.max_gap_s);
    return tree_cost(refit_tree(tree, series, r));
  };
  double correlation = 1.0;
  for (const GrownBody& b : tree.bodies) {
    if (b.link > 0) correlation = std::max(correlation, b.attachment.fit.correlation);
  }
  for (const double step : {0.05, 0.02, 0.005}) {
    const double left = cost_at(offset.value_s - step);
    const double middle = cost_at(offset.value_s);
    const double right = cost_at(offset.value_s + step);
    const double curvature = (left - 2.0 * middle + right) / (step * step);
    if (!(curvature > 0.0)) break;
    const double shift = 0.5 * (left - right) / (curvature * step);
    offset.value_s += std::clamp(shift, -2.0 * step, 2.0 * step);
    offset.sigma_s = std::sqrt(2.0 * correlation / curvature);
  }
  offset.value_s =
      std::clamp(offset.value_s, -options.max_time_offset_s, options.max_time_offset_s);
  return offset;
}

struct Search {
  GrownTree tree;
  Readings readings;
  TimeOffset offset;
};

bool has_driven_joint(const GrownTree& tree) {
  return std::ranges::any_of(
      tree.links, [](const GrownLink& l) { return l.founder >= 0 && l.attachment.driven(); });
}

// Channels of one log are mostly of one kind: when the clear joints are in rad and m, the others
// are too.
double si_share_of(const GrownTree& tree, const Readings& readings) {
  int si = 0;
  int driven = 0;
  for (const GrownLink& link : tree.links) {
    if (link.founder < 0 || !link.attachment.driven()) continue;
    const ChainFit& fit = link.attachment.fit;
    std::size_t t = 0;
    for (const ChainJoint& joint : fit.model.joints) {
      const double rms = readings.rms[static_cast<std::size_t>(joint.terms.front().channel)];
      const double sigma = fit.scale_sigma[t] * std::sqrt(fit.correlation) / rms;
      const double away = std::abs(std::abs(joint.terms.front().scale) / rms - 1.0);
      ++driven;
      if (away < 0.01 + 3.0 * sigma && sigma < 0.3) ++si;
      t += joint.terms.size();
    }
  }
  return driven >= 3 && 3 * si > 2 * driven ? 0.98 : readings.si_share;
}

Search search(const Series& full, const Series& thin, const JointLog& log,
              const StructureOptions& options) {
  Search s;
  const bool scan = options.scan_time_offset && thin.smooth && !log.channels.empty();
  if (scan)
    s.offset.value_s = scan_time_offset(full, log, options.max_time_offset_s, options.max_gap_s);
  s.readings = readings_at(log, thin, s.offset.value_s, options.max_gap_s);
  s.tree = grow_tree(thin, s.readings);
  const double si_share = si_share_of(s.tree, s.readings);
  if (si_share > s.readings.si_share) {
    s.readings.si_share = si_share;
    s.tree = grow_tree(thin, s.readings);
  }
  if (!scan || !has_driven_joint(s.tree)) return s;
  const TimeOffset refined =
      refine_offset(s.tree, thin, log, s.readings, s.offset.value_s, options);
  const bool moved = std::abs(refined.value_s - s.offset.value_s) > kOffsetMoved;
  s.offset = refined;
  s.readings = readings_at(log, thin, s.offset.value_s, options.max_gap_s);
  s.readings.si_share = si_share;
  s.tree = moved ? grow_tree(thin, s.readings) : refit_tree(s.tree, thin, s.readings);
  return s;
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
  Search s = search(full, thin, log, options);
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
