// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/growth_state.h"

#include <algorithm>
#include <limits>

#include "kinematics/structure/attachment_cost.h"
#include "kinematics/structure/find_attachments.h"
#include "kinematics/structure/first_look.h"
#include "kinematics/structure/move_bodies.h"
#include "kinematics/structure/rest.h"

namespace kinescope::structure_search {
namespace {

// Added to the cost of a free body that is seen to rest.
constexpr double kNeverFree = 1e6;
// Cost per sighting above that of the best known attachment from which none is refined.
constexpr double kGiveUpMargin = 3.0;

std::vector<char> channels_that_move(const Readings& readings) {
  std::vector<char> usable;
  usable.reserve(static_cast<std::size_t>(readings.channels()));
  for (int c = 0; c < readings.channels(); ++c) usable.push_back(readings.moves(c) ? 1 : 0);
  return usable;
}

// By cost, tempered by the correlation that the closest one leaves, and what else is held against
// each.
template <typename Price>
const Attachment* best_of(const std::vector<Attachment>& alternatives, Price price) {
  if (alternatives.empty()) return nullptr;
  const double correlation =
      std::ranges::min_element(alternatives, {}, &Attachment::data_cost)->fit.correlation;
  const auto cost = [&](const Attachment& a) { return a.cost(correlation) + price(a); };
  return &*std::ranges::min_element(alternatives, {}, cost);
}

}  // namespace

GrowthState start_growth(const Series& series, const Readings& readings,
                         const GrowthOptions& options, const std::vector<double>& likely_cost) {
  GrowthState state{.series = series,
                    .readings = readings,
                    .options = options,
                    .usable = channels_that_move(readings),
                    .likely_cost = likely_cost,
                    .moves_freely = std::vector<char>(series.bodies.size(), 0),
                    .tree = {}};
  state.likely_cost.resize(series.bodies.size(), std::numeric_limits<double>::infinity());
  for (const Body& body : series.bodies) {
    const FreeCost free = free_cost(body, readings);
    GrownBody& grown = state.tree.bodies.emplace_back();
    grown.free_cost = free.as_seen;
    grown.everywhere_cost = std::max(free.as_seen, free.everywhere);
  }
  GrownLink camera;
  camera.path = camera_path(series.size());
  add_link(state, std::move(camera));
  return state;
}

GrowthState continued_growth(GrownTree tree, const Series& series, const Readings& readings,
                             const GrowthOptions& options) {
  return {.series = series,
          .readings = readings,
          .options = options,
          .usable = channels_that_move(readings),
          .likely_cost =
              std::vector<double>(series.bodies.size(), std::numeric_limits<double>::infinity()),
          .moves_freely = std::vector<char>(series.bodies.size(), 0),
          .tree = std::move(tree)};
}

void add_link(GrowthState& state, GrownLink link) {
  state.tree.links.push_back(std::move(link));
  const int index = static_cast<int>(state.tree.links.size()) - 1;
  for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) list_alternatives(state, b, index);
}

void list_alternatives(GrowthState& state, std::size_t body, int link) {
  const Body& seen = state.series.bodies[body];
  const LinkPath& path = state.tree.link(link).path;
  GrownBody& grown = state.tree.bodies[body];
  if (state.tree.link(link).founder == static_cast<int>(body)) return;
  if (grown.link >= 0 && is_below(state.tree, link, body)) return;
  AttachmentOptions options;
  options.give_up_above = state.likely_cost[body];
  const Attachment* best = best_of(grown.alternatives, [](const Attachment&) { return 0.0; });
  if (best != nullptr && seen.seen > 0) {
    const double known = std::max(0.0, best->data_cost / seen.seen) + kGiveUpMargin;
    options.give_up_above = std::min(options.give_up_above, known);
  }
  const FirstLook look =
      first_look(seen, path, state.readings, state.usable, options.give_up_above);
  std::vector<Attachment> found;
  if (look.may_hang) {
    found = find_attachments(seen, link, path, state.readings, state.usable, options);
  }
  std::optional<Attachment> rest;
  if (look.may_rest) rest = practical_rest(seen, link, path, state.readings);
  for (Attachment& a : found) {
    if (rest && !a.driven()) continue;
    if (state.moves_freely[body] != 0 && !a.at_rest() && !a.driven()) continue;
    grown.alternatives.push_back(std::move(a));
  }
  if (!rest) return;
  grown.rests_on = link;
  // Nothing that moves freely stays where it is.
  grown.free_cost = std::max(grown.free_cost, rest->data_cost + kNeverFree);
  grown.everywhere_cost = std::max(grown.everywhere_cost, grown.free_cost);
  grown.alternatives.push_back(*rest);
}

void list_all_alternatives(GrowthState& state) {
  for (std::size_t l = 0; l < state.tree.links.size(); ++l) {
    for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) {
      list_alternatives(state, b, static_cast<int>(l));
    }
  }
}

bool look_again_at_free_bodies(GrowthState& state) {
  bool any = false;
  for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) {
    if (state.tree.bodies[b].link >= 0 ||
        state.likely_cost[b] == std::numeric_limits<double>::infinity())
      continue;
    any = true;
    state.likely_cost[b] = std::numeric_limits<double>::infinity();
    state.tree.bodies[b].alternatives.clear();
    for (std::size_t l = 0; l < state.tree.links.size(); ++l) {
      list_alternatives(state, b, static_cast<int>(l));
    }
  }
  return any;
}

bool is_acceptable(const GrowthState& state, std::size_t body, const Attachment& a) {
  const GrownBody& grown = state.tree.bodies[body];
  if (a.at_rest() && grown.rests_on == a.parent) return true;
  const GrowthOptions& options = state.options;
  const double ratio = a.explained_ratio();
  const bool followed = a.driven() && ratio > options.accept_ratio;
  if (a.data_cost >= grown.free_cost && !followed) return false;
  const bool clean = a.fit.variance <= options.accept_variance || ratio > options.accept_ratio;
  if (a.at_rest() || a.driven()) return clean;
  // A joint without a channel has to leave much less than it explains, or free bodies pass as
  // joints.
  return clean && ratio > options.free_ratio;
}

const Attachment* acceptable_best(const GrowthState& state, std::size_t body) {
  const std::vector<Attachment>& alternatives = state.tree.bodies[body].alternatives;
  const Attachment* best =
      best_of(alternatives, [&](const Attachment& a) { return price_of_sharing(state, body, a); });
  if (best == nullptr || is_acceptable(state, body, *best)) return best;
  if (best->at_rest() || best->driven()) return nullptr;
  const Attachment* other = nullptr;
  for (const Attachment& a : alternatives) {
    const bool free = !a.driven() && !a.at_rest();
    if (free || a.parent != best->parent || !is_acceptable(state, body, a)) continue;
    if (other == nullptr || a.data_cost < other->data_cost) other = &a;
  }
  return other;
}

}  // namespace kinescope::structure_search
