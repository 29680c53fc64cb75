// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/idle_channels.h"

#include <algorithm>
#include <cmath>

namespace kinescope::structure_search {
namespace {

// Of channels that move, those that drive nothing that carries a marker.
constexpr double kIdleShare = 0.1;

// Standard deviations by which a joint moves with its channel, or it is as good as at rest.
constexpr double kMoves = 4.0;

// Takes the main channels out that move the attachment's joints.
void use(const Attachment& attachment, std::vector<char>& idle) {
  const ChainFit& fit = attachment.fit;
  std::size_t t = 0;
  for (const ChainJoint& joint : fit.model.joints) {
    if (joint.terms.empty()) continue;
    const double sigma =
        t < fit.scale_sigma.size() ? fit.scale_sigma[t] * std::sqrt(fit.correlation) : 0.0;
    const ChainTerm& main = joint.terms.front();
    if (std::abs(main.scale) > kMoves * sigma) idle[static_cast<std::size_t>(main.channel)] = 0;
    t += joint.terms.size();
  }
}

// Without what the body's own joint uses.
std::vector<char> idle_without(const GrownTree& tree, const Readings& readings, int body) {
  std::vector<char> idle;
  for (int c = 0; c < readings.channels(); ++c) idle.push_back(readings.moves(c) ? 1 : 0);
  for (const GrownLink& link : tree.links) {
    if (link.founder >= 0 && link.founder != body) use(link.attachment, idle);
  }
  return idle;
}

double cost_of(const std::vector<char>& idle, const Readings& readings) {
  return idle_cost(static_cast<int>(std::ranges::count(idle, 1)), readings);
}

}  // namespace

std::vector<char> idle_channels(const GrownTree& tree, const Readings& readings) {
  return idle_without(tree, readings, -1);
}

double idle_cost(int idle, const Readings& readings) {
  // penalty_of() has every joint choose among all channels.
  const double each = 2.0 * std::log((1.0 - kIdleShare) / kIdleShare) +
                      2.0 * std::log(std::max(1, readings.channels()));
  return idle * each - 2.0 * std::lgamma(idle + 1.0);
}

double idle_cost(const GrownTree& tree, const Readings& readings) {
  return cost_of(idle_channels(tree, readings), readings);
}

double idle_change(const GrownTree& tree, const Readings& readings, std::size_t body,
                   const Attachment& attachment) {
  std::vector<char> then = idle_without(tree, readings, static_cast<int>(body));
  std::vector<char> now = then;
  if (own_link(tree, body) >= 0) use(tree.bodies[body].attachment, now);
  use(attachment, then);
  return cost_of(then, readings) - cost_of(now, readings);
}

}  // namespace kinescope::structure_search
