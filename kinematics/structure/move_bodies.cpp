// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/move_bodies.h"

#include <algorithm>

#include "kinematics/structure/attach_bodies.h"
#include "kinematics/structure/attachment_cost.h"
#include "kinematics/structure/attachment_path.h"
#include "kinematics/structure/find_attachments.h"
#include "kinematics/structure/idle_channels.h"
#include "kinematics/structure/rest.h"

namespace kinescope::structure_search {
namespace {

bool contains(const std::vector<int>& links, int link) {
  return std::ranges::find(links, link) != links.end();
}

// Recomputes the path of a link and those below it, with the joints below; gives these links.
std::vector<int> recompute_paths(GrowthState& state, int link) {
  std::vector<int> touched;
  for (int l = 1; l < static_cast<int>(state.tree.links.size()); ++l) {
    GrownLink& g = state.tree.link(l);
    if (l != link && !contains(touched, g.parent)) continue;
    touched.push_back(l);
    const std::size_t founder = state.tree.founder_of(l);
    const Body& body = state.series.bodies[founder];
    const LinkPath& parent = state.tree.link(g.parent).path;
    if (l != link) g.attachment = refit(g.attachment, body, parent, state.readings);
    state.tree.bodies[founder].attachment = g.attachment;
    g.path = path_of(g.attachment, body, parent, state.readings);
  }
  return touched;
}

// Recomputes all that hangs on a link whose attachment has changed, and what was said against it.
void refresh(GrowthState& state, int link) {
  link = sort_links(state.tree)[static_cast<std::size_t>(link)];
  const std::vector<int> touched = recompute_paths(state, link);
  for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) {
    GrownBody& g = state.tree.bodies[b];
    std::erase_if(g.alternatives, [&](const Attachment& a) { return contains(touched, a.parent); });
    for (const int l : touched) list_alternatives(state, b, l);
    if (g.attachment.at_rest() && contains(touched, g.link)) {
      g.attachment =
          refit(g.attachment, state.series.bodies[b], state.tree.link(g.link).path, state.readings);
    }
  }
}

// Sets everything at and below the founder's link free; the link itself is still there.
void release(GrownTree& tree, std::size_t founder) {
  for (GrownBody& body : tree.bodies) {
    if (is_below(tree, body.link, founder)) body.link = -1;
  }
}

// Takes out the links without founder. What is known of the others stays, since their paths do.
std::vector<int> remove_released(GrownTree& tree) {
  std::vector<std::vector<Attachment>> known;
  for (GrownBody& body : tree.bodies) known.push_back(std::move(body.alternatives));
  std::vector<int> renamed = remove_links_without_founder(tree);
  const auto now = [&](int link) {
    return link < 0 ? -1 : renamed[static_cast<std::size_t>(link)];
  };
  for (std::size_t b = 0; b < tree.bodies.size(); ++b) {
    GrownBody& body = tree.bodies[b];
    for (Attachment& a : known[b]) {
      a.parent = now(a.parent);
      if (a.parent >= 0) body.alternatives.push_back(std::move(a));
    }
  }
  return renamed;
}

// The founder of `own` turns out to rest on another link: everything on `own` is looked at anew.
void dissolve(GrowthState& state, int own, Attachment attachment) {
  GrownTree& tree = state.tree;
  const std::size_t founder = tree.founder_of(own);
  release(tree, founder);
  const std::vector<int> renamed = remove_links_without_founder(tree);
  attachment.parent = renamed[static_cast<std::size_t>(attachment.parent)];
  tree.bodies[founder].link = attachment.parent;
  tree.bodies[founder].attachment = std::move(attachment);
  list_all_alternatives(state);
  attach_all(state);
}

// Takes out a link and everything on it; its own bodies may no longer hang by joints without
// channels.
void set_free(GrowthState& state, int link) {
  for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) {
    if (state.tree.bodies[b].link == link) state.moves_freely[b] = 1;
  }
  release(state.tree, state.tree.founder_of(link));
  remove_links_without_founder(state.tree);
  list_all_alternatives(state);
  attach_all(state);
}

}  // namespace

bool conflicts(const GrownTree& tree, std::size_t body, const Attachment& a) {
  if (!a.driven()) return false;
  return std::ranges::any_of(tree.links, [&](const GrownLink& l) {
    return l.founder >= 0 && l.founder != static_cast<int>(body) &&
           l.attachment.channel() == a.channel() &&
           l.attachment.fit.model.joints.front().terms.size() == 1;
  });
}

double price_of_sharing(const GrowthState& state, std::size_t body, const Attachment& a) {
  return conflicts(state.tree, body, a) ? price_of_further_channel(state.readings) : 0.0;
}

void move_body(GrowthState& state, std::size_t body, Attachment attachment) {
  GrownBody& grown = state.tree.bodies[body];
  const int own = own_link(state.tree, body);
  grown.attachment = attachment;
  if (own >= 0 && !attachment.at_rest()) {
    GrownLink& link = state.tree.link(own);
    link.parent = attachment.parent;
    link.attachment = std::move(attachment);
    refresh(state, own);
  } else if (own >= 0) {
    dissolve(state, own, std::move(attachment));
  } else {
    place(state, body, std::move(attachment));
  }
}

int release_link(GrowthState& state, int link) {
  const int parent = state.tree.link(link).parent;
  release(state.tree, state.tree.founder_of(link));
  return remove_released(state.tree)[static_cast<std::size_t>(parent)];
}

void release_children(GrowthState& state, int link, std::size_t body) {
  state.tree.bodies[body].link = -1;
  for (int l = 1; l < static_cast<int>(state.tree.links.size()); ++l) {
    if (state.tree.link(l).parent == link) release(state.tree, state.tree.founder_of(l));
  }
  remove_released(state.tree);
}

bool improve(GrowthState& state, std::size_t body) {
  constexpr double kLeastGain = 1e-6;  // less is rounding
  const GrownBody& grown = state.tree.bodies[body];
  if (grown.link < 0) return false;
  const double correlation = grown.attachment.fit.correlation;
  const Attachment* best = nullptr;
  double least = grown.attachment.cost(correlation) +
                 price_of_sharing(state, body, grown.attachment) - kLeastGain;
  for (const Attachment& a : grown.alternatives) {
    if (is_below(state.tree, a.parent, body) || conflicts(state.tree, body, a)) continue;
    const bool free = !a.at_rest() && !a.driven();
    if (free && !is_acceptable(state, body, a)) continue;
    const double cost = a.cost(correlation) + idle_change(state.tree, state.readings, body, a);
    if (cost >= least) continue;
    least = cost;
    best = &a;
  }
  if (best == nullptr) return false;
  move_body(state, body, *best);
  return true;
}

bool give_up_contradicted_joint(GrowthState& state) {
  const GrownTree& tree = state.tree;
  for (int l = 1; l < static_cast<int>(tree.links.size()); ++l) {
    if (tree.link(l).attachment.driven()) continue;
    const std::size_t founder = tree.founder_of(l);
    const double size = tree.bodies[founder].attachment.motion_size;
    for (std::size_t b = 0; b < tree.bodies.size(); ++b) {
      if (tree.bodies[b].link >= 0 || !rest_on_each_other(state.series.bodies[founder], size,
                                                          state.series.bodies[b], state.readings)) {
        continue;
      }
      set_free(state, l);
      return true;
    }
  }
  return false;
}

}  // namespace kinescope::structure_search
