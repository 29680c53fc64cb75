// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/attach_bodies.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "kinematics/structure/attachment_path.h"
#include "kinematics/structure/idle_channels.h"
#include "kinematics/structure/move_bodies.h"
#include "kinematics/structure/several_joints.h"

namespace kinescope::structure_search {
namespace {

struct Choice {
  std::size_t body = 0;
  const Attachment* attachment = nullptr;
};

// The free body that fits best anywhere: rest first, then driven joints, then free coordinates;
// within each the cleanest.
std::optional<Choice> next_to_attach(const GrowthState& state) {
  std::optional<Choice> chosen;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) {
    if (state.tree.bodies[b].link >= 0) continue;
    const Attachment* best = acceptable_best(state, b);
    if (best == nullptr) continue;
    const double rank = best->at_rest() ? 0.0 : best->driven() ? 1e3 : 1e6;
    const double badness = rank + best->data_cost / std::max(1, state.series.bodies[b].seen);
    if (badness < least) {
      least = badness;
      chosen = {b, best};
    }
  }
  return chosen;
}

// ln det of the covariance of a sighting, mean.
double noise_of(const Body& body) {
  double sum = 0.0;
  for (const Sighting& s : body.at)
    if (s.seen) sum -= 2.0 * s.whitening.diagonal().array().abs().log().sum();
  return sum / std::max(1, body.seen);
}

bool hang_alike(const Attachment& a, const Attachment& b) {
  return a.parent == b.parent && a.driven() && b.driven() && a.channel() == b.channel() &&
         a.fit.model.joints.size() == 1 && b.fit.model.joints.size() == 1 &&
         a.fit.model.joints.front().type == b.fit.model.joints.front().type;
}

// Of bodies that may be of one link, the one that is seen best: what its joint leaves open is in
// doubt for the others, and more of it than they know by themselves would set them apart.
Choice seen_best(const GrowthState& state, Choice chosen) {
  double least = noise_of(state.series.bodies[chosen.body]);
  const Attachment* cleanest = chosen.attachment;
  for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) {
    if (state.tree.bodies[b].link >= 0) continue;
    const Attachment* best = acceptable_best(state, b);
    if (best == nullptr || !hang_alike(*best, *cleanest) || !best->leaves_noise_only()) continue;
    const double noise = noise_of(state.series.bodies[b]);
    if (noise < least) {
      least = noise;
      chosen = {b, best};
    }
  }
  return chosen;
}

// Moving channels that drive no joint yet.
std::vector<char> unused_channels(const GrowthState& state) {
  std::vector<char> unused = state.usable;
  for (const GrownLink& l : state.tree.links) {
    for (const ChainJoint& j : l.attachment.fit.model.joints) {
      if (!j.terms.empty()) unused[static_cast<std::size_t>(j.terms.front().channel)] = 0;
    }
  }
  return unused;
}

struct SerialCase {
  std::size_t body;
  int link;
  SerialOutlook outlook;
};

// Free bodies and links with something to say for several joints between, simplest first.
std::vector<SerialCase> serial_cases(const GrowthState& state, const std::vector<char>& unused) {
  std::vector<SerialCase> cases;
  for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) {
    if (state.tree.bodies[b].link >= 0) continue;
    for (std::size_t l = 0; l < state.tree.links.size(); ++l) {
      const SerialOutlook o =
          serial_outlook(state.series.bodies[b], state.tree.links[l].path, state.readings, unused);
      if (o.channels > 0) cases.push_back({b, static_cast<int>(l), o});
    }
  }
  std::ranges::stable_sort(cases, {}, [](const SerialCase& c) {
    return std::pair(c.outlook.channels, c.outlook.residual);
  });
  return cases;
}

}  // namespace

void place(GrowthState& state, std::size_t body, Attachment attachment) {
  GrownBody& grown = state.tree.bodies[body];
  grown.attachment = attachment;
  if (attachment.at_rest()) {
    grown.link = attachment.parent;
    return;
  }
  GrownLink link;
  link.parent = attachment.parent;
  link.founder = static_cast<int>(body);
  link.path = path_of(attachment, state.series.bodies[body], state.tree.link(link.parent).path,
                      state.readings);
  link.attachment = std::move(attachment);
  grown.link = static_cast<int>(state.tree.links.size());
  add_link(state, std::move(link));
}

void attach_all(GrowthState& state) {
  while (const auto next = next_to_attach(state)) {
    const Choice founder = seen_best(state, *next);
    // A copy: new links bring new alternatives.
    place(state, founder.body, Attachment(*founder.attachment));
  }
}

bool attach_through_unseen_links(GrowthState& state) {
  constexpr std::size_t kMostCases = 6;
  const std::vector<char> unused = unused_channels(state);
  const std::vector<SerialCase> cases = serial_cases(state, unused);
  for (std::size_t i = 0; i < std::min(cases.size(), kMostCases); ++i) {
    const SerialCase& c = cases[i];
    auto found = find_serial_attachment(state.series.bodies[c.body], c.link,
                                        state.tree.link(c.link).path, state.readings, unused);
    if (!found || !is_acceptable(state, c.body, *found)) continue;
    state.tree.bodies[c.body].alternatives.push_back(*found);
    place(state, c.body, std::move(*found));
    return true;
  }
  return false;
}

bool is_coarse(const Attachment& attachment, bool channel_left) {
  constexpr double kCoarse = 4.0;  // variance across the joint over the declared one
  return attachment.driven() && attachment.fit.model.joints.size() == 1 &&
         (channel_left || attachment.fit.model.joints.front().terms.size() > 1) &&
         attachment.fit.variance > kCoarse;
}

bool unfold_coarse_joint(GrowthState& state) {
  for (int l = 1; l < static_cast<int>(state.tree.links.size()); ++l) {
    const GrownLink& link = state.tree.link(l);
    std::vector<char> channels = unused_channels(state);
    if (!is_coarse(link.attachment, std::ranges::find(channels, 1) != channels.end())) continue;
    channels[static_cast<std::size_t>(link.attachment.channel())] = 1;
    const std::size_t body = state.tree.founder_of(l);
    auto found =
        find_serial_attachment(state.series.bodies[body], link.parent,
                               state.tree.link(link.parent).path, state.readings, channels);
    if (!found || !is_acceptable(state, body, *found)) continue;
    const double correlation = std::min(found->fit.correlation, link.attachment.fit.correlation);
    const double change = found->cost(correlation) - link.attachment.cost(correlation) +
                          idle_change(state.tree, state.readings, body, *found);
    if (change >= 0.0) continue;
    move_body(state, body, std::move(*found));
    return true;
  }
  return false;
}

}  // namespace kinescope::structure_search
