// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/assign_channels.h"

#include <algorithm>
#include <limits>

#include "kinematics/structure/move_bodies.h"
#include "kinematics/structure/natural_units.h"

namespace kinescope::structure_search {
namespace {

// What a joint has to lose without a channel (-2 ln likelihood) to share it: drives of two joints
// are rare.
constexpr double kRare = 25.0;

// Largest matching of joints and channels they depend on (Kuhn 1955, by augmenting paths); terms
// that move a joint more come first.
class Matching {
 public:
  Matching(const GrownTree& tree, std::size_t channels) : tree_(tree), owner_(channels, -1) {}

  // Finds a channel for the link's joint; others move on to another of theirs where need be.
  void add(int link) {
    std::vector<char> visited(owner_.size(), 0);
    claim(link, visited);
  }

  // Link that has each channel; -1: none.
  [[nodiscard]] const std::vector<int>& owner() const { return owner_; }

 private:
  bool claim(int link, std::vector<char>& visited) {
    for (const ChainTerm& t : tree_.link(link).attachment.fit.model.joints.front().terms) {
      const auto c = static_cast<std::size_t>(t.channel);
      if (visited[c] != 0) continue;
      visited[c] = 1;
      if (owner_[c] >= 0 && !claim(owner_[c], visited)) continue;
      owner_[c] = link;
      return true;
    }
    return false;
  }

  const GrownTree& tree_;
  std::vector<int> owner_;
};

// Puts the link's term of this channel first.
void make_main(GrownTree& tree, int link, int channel) {
  Attachment& attachment = tree.link(link).attachment;
  auto& terms = attachment.fit.model.joints.front().terms;
  auto& sigma = attachment.fit.scale_sigma;
  for (std::size_t t = 1; t < terms.size(); ++t) {
    if (terms[t].channel != channel) continue;
    std::swap(terms[0], terms[t]);
    std::swap(sigma[0], sigma[t]);
  }
  tree.bodies[tree.founder_of(link)].attachment = attachment;
}

// Gives as many single joints as possible a main channel of their own; those with the fewest
// channels choose first.
void deal_main_channels(GrownTree& tree, std::size_t channels) {
  std::vector<int> single;
  for (int l = 1; l < static_cast<int>(tree.links.size()); ++l) {
    const Attachment& a = tree.link(l).attachment;
    if (a.driven() && a.fit.model.joints.size() == 1) single.push_back(l);
  }
  std::ranges::stable_sort(single, {}, [&](int l) {
    return tree.link(l).attachment.fit.model.joints.front().terms.size();
  });
  Matching matching(tree, channels);
  for (const int l : single) matching.add(l);
  for (std::size_t c = 0; c < channels; ++c) {
    if (matching.owner()[c] >= 0) make_main(tree, matching.owner()[c], static_cast<int>(c));
  }
}

struct Replacement {
  const Attachment* attachment = nullptr;  // null: none
  double loss = std::numeric_limits<double>::infinity();
};

// The link's next best explanation that does without the channel.
Replacement without_channel(const GrowthState& state, int link, int channel) {
  const Attachment& now = state.tree.link(link).attachment;
  const std::size_t founder = state.tree.founder_of(link);
  const double correlation = now.fit.correlation;
  const Attachment* best = nullptr;
  for (const Attachment& a : state.tree.bodies[founder].alternatives) {
    if (a.channel() == channel || is_below(state.tree, a.parent, founder)) continue;
    if (conflicts(state.tree, founder, a) || !is_acceptable(state, founder, a)) continue;
    if (best == nullptr || a.cost(correlation) < best->cost(correlation)) best = &a;
  }
  if (best == nullptr) return {};
  return {best, best->cost(correlation) - now.cost(correlation)};
}

// Of two joints with one main channel, replaces the one that loses least; false when neither can,
// or when both have it rightly.
bool resolve(GrowthState& state, int l, int m, int channel) {
  const Replacement of_l = without_channel(state, l, channel);
  const Replacement of_m = without_channel(state, m, channel);
  if (of_l.attachment == nullptr && of_m.attachment == nullptr) return false;
  if (std::min(of_l.loss, of_m.loss) > kRare &&
      share_a_channel(state.tree.link(l).attachment, state.tree.link(m).attachment,
                      state.readings)) {
    return false;
  }
  const bool take_l =
      of_m.attachment == nullptr || (of_l.attachment != nullptr && of_l.loss < of_m.loss);
  move_body(state, state.tree.founder_of(take_l ? l : m),
            take_l ? *of_l.attachment : *of_m.attachment);
  return true;
}

}  // namespace

bool assign_channels(GrowthState& state) {
  deal_main_channels(state.tree, state.usable.size());
  bool changed = false;
  // The tree may lose links on the way.
  for (int l = 1; l < static_cast<int>(state.tree.links.size()); ++l) {
    for (int m = l + 1; m < static_cast<int>(state.tree.links.size()); ++m) {
      const int channel = state.tree.link(l).attachment.channel();
      if (channel < 0 || channel != state.tree.link(m).attachment.channel()) continue;
      changed = resolve(state, l, m, channel) || changed;
    }
  }
  return changed;
}

}  // namespace kinescope::structure_search
