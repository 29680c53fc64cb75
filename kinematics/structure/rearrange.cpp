// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/rearrange.h"

#include <algorithm>
#include <optional>
#include <tuple>

#include "kinematics/structure/assign_channels.h"
#include "kinematics/structure/attach_bodies.h"
#include "kinematics/structure/idle_channels.h"
#include "kinematics/structure/move_bodies.h"

namespace kinescope::structure_search {
namespace {

constexpr int kMostRounds = 4;  // in which bodies may change places
// Less (-2 ln odds) is rounding.
constexpr double kGain = 1e-6;
// Markers that share a link are put apart where that loses less than this by itself.
constexpr double kWorthTrying = 40.0;
constexpr std::size_t kMostTries = 4;

// A link to be taken apart: `first` hangs where it hung, by `channel`, and `second` on `first`.
struct Split {
  int link = 0;
  int first = -1;  // -1: the camera
  std::size_t second = 0;
  int channel = -1;
  double loss = 0.0;
};

// The best joint by which a body may hang on a link.
const Attachment* best_joint(const GrowthState& state, std::size_t body, int link) {
  const GrownBody& grown = state.tree.bodies[body];
  const Attachment* best = nullptr;
  double least = 0.0;
  for (const Attachment& a : grown.alternatives) {
    if (a.parent != link || !a.driven() || !is_acceptable(state, body, a)) continue;
    const double cost =
        a.cost(a.fit.correlation) + idle_change(state.tree, state.readings, body, a);
    if (best != nullptr && cost >= least) continue;
    best = &a;
    least = cost;
  }
  return best;
}

// The body on the link by the channel; nothing where that is not acceptable.
const Attachment* by_channel(const GrowthState& state, std::size_t body, int parent, int channel) {
  const Attachment* best = nullptr;
  for (const Attachment& a : state.tree.bodies[body].alternatives) {
    if (a.parent != parent || a.channel() != channel || !is_acceptable(state, body, a)) continue;
    if (best == nullptr || a.data_cost < best->data_cost) best = &a;
  }
  return best;
}

// What it loses that a body at rest hangs by a joint; nothing where none is known.
std::optional<double> loss_of_split(const GrowthState& state, std::size_t body) {
  const GrownBody& grown = state.tree.bodies[body];
  const Attachment* joint = best_joint(state, body, grown.link);
  if (joint == nullptr) return std::nullopt;
  const double correlation = std::min(grown.attachment.fit.correlation, joint->fit.correlation);
  return joint->cost(correlation) - grown.attachment.cost(correlation) +
         idle_change(state.tree, state.readings, body, *joint);
}

// Markers that share a link may be of two, while a channel drives nothing.
void add_shared_links(const GrowthState& state, std::vector<Split>& splits) {
  const std::vector<char> idle = idle_channels(state.tree, state.readings);
  if (std::ranges::find(idle, 1) == idle.end()) return;
  for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) {
    const GrownBody& grown = state.tree.bodies[b];
    if (grown.link < 0 || !grown.attachment.at_rest() || own_link(state.tree, b) >= 0) continue;
    const std::optional<double> loss = loss_of_split(state, b);
    if (!loss || *loss > kWorthTrying) continue;
    const GrownLink& link = state.tree.link(grown.link);
    const int channel = link.attachment.channel();
    splits.push_back({grown.link, link.founder, b, channel, *loss});
    if (link.founder < 0) continue;
    splits.push_back(
        {grown.link, static_cast<int>(b), static_cast<std::size_t>(link.founder), channel, *loss});
  }
}

// A body that would as well hang where its parent hangs, by the parent's channel, may stand between
// the two: the parent's joint then is both, one after the other.
void add_passed_over(const GrowthState& state, std::vector<Split>& splits) {
  const GrownTree& tree = state.tree;
  for (int l = 1; l < static_cast<int>(tree.links.size()); ++l) {
    const GrownLink& link = tree.link(l);
    const GrownLink& nearer = tree.link(link.parent);
    if (nearer.founder < 0 || !link.attachment.driven() || !nearer.attachment.driven()) continue;
    const std::size_t body = tree.founder_of(l);
    for (const ChainTerm& t : nearer.attachment.fit.model.joints.front().terms) {
      const Attachment* between = by_channel(state, body, nearer.parent, t.channel);
      if (between == nullptr || t.channel == link.attachment.channel()) continue;
      const double correlation =
          std::min(between->fit.correlation, link.attachment.fit.correlation);
      const double loss = between->cost(correlation) - link.attachment.cost(correlation);
      if (loss > kWorthTrying) continue;
      splits.push_back(
          {link.parent, link.founder, static_cast<std::size_t>(nearer.founder), t.channel, loss});
    }
  }
}

std::vector<Split> likely_splits(const GrowthState& state) {
  std::vector<Split> splits;
  add_shared_links(state, splits);
  add_passed_over(state, splits);
  std::ranges::stable_sort(splits, {}, &Split::loss);
  if (splits.size() > kMostTries) splits.resize(kMostTries);
  return splits;
}

// The tree with the link taken apart and everything beyond hung anew; false where it cannot be.
bool split_apart(GrowthState& state, const Split& split) {
  int link = 0;
  if (split.link == 0) {
    release_children(state, 0, split.second);
  } else {
    const int parent = release_link(state, split.link);
    const auto first = static_cast<std::size_t>(split.first);
    const Attachment* stays = by_channel(state, first, parent, split.channel);
    if (stays == nullptr) return false;
    place(state, first, Attachment(*stays));
    link = state.tree.bodies[first].link;
  }
  const Attachment* joint = best_joint(state, split.second, link);
  if (joint == nullptr) return false;
  place(state, split.second, Attachment(*joint));
  attach_all(state);
  rearrange(state);
  return true;
}

// First body of a link; -1: the camera's.
int first_body(const GrownTree& tree, int link) {
  if (link <= 0) return link - 1;
  for (std::size_t b = 0; b < tree.bodies.size(); ++b) {
    if (tree.bodies[b].link == link) return static_cast<int>(b);
  }
  return -1;
}

// Where a body hangs, in terms that do not depend on the links' numbers.
auto place_of(const GrownTree& tree, std::size_t body) {
  const int l = tree.bodies[body].link;
  if (l <= 0) return std::tuple(first_body(tree, l), 0, -1, JointType::kFixed);
  const GrownLink& link = tree.link(l);
  return std::tuple(first_body(tree, l), first_body(tree, link.parent), link.attachment.channel(),
                    link.attachment.fit.model.joints.front().type);
}

bool same_tree(const GrownTree& a, const GrownTree& b) {
  for (std::size_t body = 0; body < a.bodies.size(); ++body) {
    if (place_of(a, body) != place_of(b, body)) return false;
  }
  return true;
}

// Of a body in one tree over another; errors that are alike in neighbouring samples count once, as
// in the tree that fits the body better.
double loss_of(const GrownBody& body, const GrownBody& over) {
  const double correlation =
      std::min(body.link < 0 ? over.attachment.fit.correlation : body.attachment.fit.correlation,
               over.link < 0 ? body.attachment.fit.correlation : over.attachment.fit.correlation);
  const auto cost = [&](const GrownBody& b) {
    return b.link < 0 ? b.free_cost / correlation : b.attachment.cost(correlation);
  };
  return cost(body) - cost(over);
}

// Of one tree over another. A body that has the same place in both may still hang on a path of
// other joints, each as well known as its own marker tells: that error is the same for all bodies
// further out, and would be counted for each of them.
double loss_of(const GrownTree& tree, const GrownTree& over, const Readings& readings) {
  constexpr double kPathError = 10.0;  // -2 ln likelihood: five parameters off by 1.4 sigma
  double loss = idle_cost(tree, readings) - idle_cost(over, readings);
  for (std::size_t b = 0; b < tree.bodies.size(); ++b) {
    double own = loss_of(tree.bodies[b], over.bodies[b]);
    if (place_of(tree, b) == place_of(over, b)) {
      own -= std::clamp(own, -kPathError, kPathError);
    }
    loss += own;
  }
  return loss;
}

// Tries the splits until one is better; the others become rivals.
bool split_better(GrowthState& state) {
  state.tree.rivals.clear();
  for (const Split& split : likely_splits(state)) {
    GrowthState other = state;
    if (!split_apart(other, split) || same_tree(other.tree, state.tree)) continue;
    const double loss = loss_of(other.tree, state.tree, state.readings);
    if (loss < -kGain) {
      state.tree = std::move(other.tree);
      state.likely_cost = std::move(other.likely_cost);
      return true;
    }
    state.tree.rivals.push_back({split.second, loss});
  }
  return false;
}

bool rearrange_once(GrowthState& state) {
  bool changed = false;
  for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) changed = improve(state, b) || changed;
  return assign_channels(state) || changed;
}

}  // namespace

void rearrange(GrowthState& state) {
  for (int round = 0; round < kMostRounds && rearrange_once(state); ++round) {
  }
}

bool take_links_apart(GrowthState& state) {
  constexpr int kMostSplits = 8;
  int splits = 0;
  while (splits < kMostSplits && split_better(state)) ++splits;
  return splits > 0;
}

}  // namespace kinescope::structure_search
