// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/search.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "kinematics/structure/attach_bodies.h"
#include "kinematics/structure/attachment_path.h"
#include "kinematics/structure/idle_channels.h"
#include "kinematics/structure/pair_tree.h"
#include "kinematics/structure/rearrange.h"
#include "kinematics/structure/time_offset.h"

namespace kinescope::structure_search {
namespace {

// A tree is grown again when its offset moved by more than this (s), or this many of its standard
// deviations: joints and the odds of their alternatives stand for the offset they are told with.
constexpr double kOffsetMoved = 3e-3;
constexpr double kSameSigmas = 2.0;
constexpr int kMostGrowths = 4;
// Instants of the series on which an offset is looked for first.
constexpr int kRoughInstants = 80;
// How much better (-2 ln likelihood) an offset has to be than one nearer to agreeing clocks.
constexpr double kClearlyLikelierOffset = 25.0;

// Channels of one log are mostly of one kind: when the clear joints are in rad and m, the others
// are too.
double si_share_of(const FoundTree& found) {
  const GrownTree& tree = found.tree;
  const Readings& readings = found.readings;
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
  return driven >= 3 && 3 * si > 2 * driven ? 0.98 : Readings{}.si_share;
}

bool has_driven_joint(const GrownTree& tree) {
  return std::ranges::any_of(
      tree.links, [](const GrownLink& l) { return l.founder >= 0 && l.attachment.driven(); });
}

bool has_free_body(const GrownTree& tree) {
  return std::ranges::any_of(tree.bodies, [](const GrownBody& b) { return b.link < 0; });
}

// Penalised cost as if the log covered every instant, so that offsets may be compared.
double score_of(const FoundTree& found) {
  double sum = 0.0;
  for (const GrownBody& b : found.tree.bodies) {
    sum += b.link < 0 ? b.free_cost : b.attachment.cost(1.0);
  }
  const auto valid = static_cast<double>(std::ranges::count(found.readings.valid, 1));
  return sum * static_cast<double>(found.readings.valid.size()) / std::max(1.0, valid);
}

// Every body hangs by joints with one channel each that leave nothing but noise: no other offset
// can be better.
bool explains_all(const GrownTree& tree) {
  return std::ranges::all_of(tree.bodies, [](const GrownBody& b) {
    if (b.link < 0 || b.attachment.fit.variance > kInexact) return false;
    if (b.attachment.at_rest()) return true;
    return b.attachment.driven() && b.attachment.fit.axis_variance < kInexact &&
           std::ranges::all_of(
               b.attachment.fit.model.joints,
               [](const ChainJoint& j) { return j.terms.size() == 1; });
  });
}

class Search {
 public:
  Search(const Series& full, const Series& thin, const JointLog& log,
         const StructureOptions& options)
      : thin_(thin),
        rough_(thinned(full, kRoughInstants)),
        pairs_(body_pairs(rough_, kRoughInstants)),
        log_(log),
        options_(options) {}

  // `si_share`: how likely channels are in rad and m.
  [[nodiscard]] FoundTree grow_once(double offset_s, const Series& series,
                                    const GrowthOptions& growth, double si_share) const {
    FoundTree found;
    found.offset.value_s = offset_s;
    found.readings = readings_at(log_, series, offset_s, options_.max_gap_s);
    found.readings.units = units_of(log_, options_.units);
    found.readings.last_joint_first = options_.camera_on_robot;
    found.readings.si_share = std::max(si_share, found.readings.si_share);
    found.tree = grow_tree(series, found.readings, growth, likely_costs_at(offset_s));
    return found;
  }

  // Grown again where the joints tell something else of the channels' units.
  [[nodiscard]] FoundTree grow_at(double offset_s, const GrowthOptions& growth = {},
                                  double si_share = 0.0) const {
    FoundTree found = grow_once(offset_s, thin_, growth, si_share);
    const double told = si_share_of(found);
    if (told != found.readings.si_share) {
      found.readings.si_share = told;
      found.tree = grow_tree(thin_, found.readings, growth, likely_costs_at(offset_s));
    }
    return found;
  }

  // Tree and offset settled on each other: first on few instants, for the offset's sake.
  [[nodiscard]] FoundTree settle_at(double start_s, double step_s,
                                    const GrowthOptions& options) const {
    double offset_s = start_s;
    double si_share = 0.0;
    if (2 * rough_.size() <= thin_.size()) {
      const FoundTree rough = grow_once(start_s, rough_, options, si_share);
      if (has_driven_joint(rough.tree) && !has_free_body(rough.tree)) {
        si_share = si_share_of(rough);
        offset_s = refined(rough, step_s).value_s;
      }
    }
    FoundTree found = grow_at(offset_s, options, si_share);
    for (int growth = 1; growth < kMostGrowths && has_driven_joint(found.tree); ++growth) {
      if (!grow_anew(found, step_s, options)) break;
    }
    return found;
  }

  // With links taken apart where that helps, at the offset that then is best.
  [[nodiscard]] FoundTree finished(FoundTree found, double step_s,
                                   const GrowthOptions& options) const {
    for (int growth = 1;; ++growth) {
      GrowthState state = continued_growth(std::move(found.tree), thin_, found.readings, options);
      const bool changed = take_links_apart(state);
      found.tree = std::move(state.tree);
      if (!changed || !scans() || growth == kMostGrowths) break;
      if (!grow_anew(found, step_s, options)) break;
    }
    return found;
  }

  // Clocks that may differ, of a motion that is seen as such.
  [[nodiscard]] bool scans() const {
    return options_.scan_time_offset && thin_.smooth && !log_.channels.empty();
  }

 private:
  // At the offset that the tree shows; false where that hardly moves any more.
  bool grow_anew(FoundTree& found, double step_s, const GrowthOptions& options) const {
    const TimeOffset offset = refined(found, step_s);
    const double moved = std::abs(offset.value_s - found.offset.value_s);
    found.offset.sigma_s = offset.sigma_s;
    if (moved < std::min(kOffsetMoved, kSameSigmas * offset.sigma_s)) return false;
    found = grow_at(offset.value_s, options, found.readings.si_share);
    found.offset.sigma_s = offset.sigma_s;
    return true;
  }

  [[nodiscard]] std::vector<double> likely_costs_at(double offset_s) const {
    const std::size_t bodies = rough_.bodies.size();
    const Readings readings = readings_at(log_, rough_, offset_s, options_.max_gap_s);
    return likely_costs(pair_tree(pairs_, bodies, readings), bodies);
  }

  [[nodiscard]] TimeOffset refined(const FoundTree& found, double step_s) const {
    return refine_offset(found.tree, thin_, found.readings, log_, found.offset.value_s,
                         {options_.max_time_offset_s, step_s, options_.max_gap_s});
  }

  const Series& thin_;
  Series rough_;
  std::vector<BodyPair> pairs_;
  const JointLog& log_;
  const StructureOptions& options_;
};

}  // namespace

bool is_unfinished(const FoundTree& found) {
  const std::vector<char> idle = idle_channels(found.tree, found.readings);
  const bool left = std::ranges::find(idle, 1) != idle.end();
  return has_free_body(found.tree) ||
         std::ranges::any_of(found.tree.links, [&](const GrownLink& l) {
           return l.founder >= 0 && is_coarse(l.attachment, left);
         });
}

bool uses_all(const FoundTree& found) {
  std::vector<char> used(found.readings.mean.size(), 0);
  for (const GrownLink& link : found.tree.links) {
    if (link.founder >= 0 && link.attachment.driven()) {
      used[static_cast<std::size_t>(link.attachment.channel())] = 1;
    }
  }
  for (int c = 0; c < found.readings.channels(); ++c) {
    if (found.readings.moves(c) && used[static_cast<std::size_t>(c)] == 0) return false;
  }
  return true;
}

FoundTree search_tree(const Series& full, const Series& thin, const JointLog& log,
                      const StructureOptions& options, UnseenLinks unseen) {
  const Search search(full, thin, log, options);
  const GrowthOptions quick{.paths_of_several_joints = false};
  const GrowthOptions all{.paths_of_several_joints = unseen == UnseenLinks::kWhereNeeded};
  if (!search.scans()) return search.finished(search.grow_at(0.0, all), 0.0, all);
  // The long search is not for every offset.
  const double step_s = offset_step(readings_at(log, thin, 0.0, options.max_gap_s));
  std::vector<FoundTree> found;
  found.push_back(search.settle_at(0.0, step_s, quick));
  if (explains_all(found.back().tree) && uses_all(found.back()))
    return search.finished(std::move(found.back()), step_s, quick);
  for (const double start_s :
       scan_time_offsets(full, log, step_s, options.max_time_offset_s, options.max_gap_s)) {
    const bool known = std::ranges::any_of(found, [&](const FoundTree& f) {
      return std::abs(f.offset.value_s - start_s) < 0.5 * step_s;
    });
    if (known) continue;
    found.push_back(search.settle_at(start_s, step_s, quick));
    if (explains_all(found.back().tree))
      return search.finished(std::move(found.back()), step_s, quick);
  }
  std::ranges::stable_sort(found, {},
                           [](const FoundTree& f) { return std::abs(f.offset.value_s); });
  std::size_t best = 0;
  for (std::size_t k = 1; k < found.size(); ++k) {
    if (score_of(found[k]) < score_of(found[best]) - kClearlyLikelierOffset) best = k;
  }
  if (unseen == UnseenLinks::kNone || !is_unfinished(found[best]))
    return search.finished(std::move(found[best]), step_s, quick);
  return search.finished(search.settle_at(found[best].offset.value_s, step_s, all), step_s, all);
}

}  // namespace kinescope::structure_search
