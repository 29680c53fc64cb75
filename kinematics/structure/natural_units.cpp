// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/natural_units.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "kinematics/structure/attachment_cost.h"
#include "kinematics/structure/screening.h"

namespace kinescope::structure_search {
namespace {

// A scale this close to that of a usual unit is no accident.
constexpr double kClose = 0.05;
// What the other type of joint may leave: errors that are no noise are of this size.
constexpr double kRotation = 0.03;     // rad
constexpr double kTranslation = 0.01;  // of the distance to the camera

// The channel is in rad or degrees, m or millimetres; one that is declared, in what it is declared
// in.
bool is_natural(JointType type, double scale, ChannelUnit unit) {
  if (unit != ChannelUnit::kUnknown) {
    const ChannelUnit natural =
        type == JointType::kRevolute ? ChannelUnit::kRadian : ChannelUnit::kMetre;
    return unit == natural && std::abs(std::abs(scale) - 1.0) < kClose;
  }
  const std::array<double, 2> units = type == JointType::kRevolute
                                          ? std::array{1.0, std::numbers::pi / 180.0}
                                          : std::array{1.0, 1e-3};
  return std::ranges::any_of(
      units, [&](double usual) { return std::abs(std::abs(scale) - usual) < kClose * usual; });
}

// rad or m per unit of the channel.
double scale_of(const ChainFit& fit, const Readings& readings) {
  const ChainTerm& term = fit.model.joints.front().terms.front();
  return term.scale / readings.rms[static_cast<std::size_t>(term.channel)];
}

// The body by a joint of the other type and the same channel, where that is natural and fits.
std::optional<Attachment> as_other_type(const Attachment& now, const Body& body,
                                        const LinkPath& parent, const Readings& readings) {
  const RelativeMotion relative = relative_motion(body, parent, readings);
  std::vector<char> only(static_cast<std::size_t>(readings.channels()), 0);
  only[static_cast<std::size_t>(now.channel())] = 1;
  const JointType type = now.fit.model.joints.front().type;
  for (const Candidate& candidate :
       screen_motion(relative.motion, readings.value, only, {.coordinate_free = false})) {
    if (candidate.start.joints.size() != 1 || candidate.channel != now.channel()) continue;
    const JointType other = candidate.start.joints.front().type;
    if (other == type) continue;
    ChainFit fit = fit_chain(relative.motion, readings.value, candidate.start);
    const bool fits = fit.rotation_rms < kRotation &&
                      fit.translation_rms < kTranslation * distance_of({&body, 1});
    if (!fits || !is_natural(other, scale_of(fit, readings), readings.unit(now.channel())))
      continue;
    return attachment_from(std::move(fit), now.parent, relative, body, readings);
  }
  return std::nullopt;
}

bool is_odd(const Attachment& attachment, const Readings& readings) {
  return attachment.driven() && attachment.fit.model.joints.size() == 1 &&
         !is_natural(attachment.fit.model.joints.front().type, scale_of(attachment.fit, readings),
                     readings.unit(attachment.channel()));
}

// Channels that agree this well are multiples of each other.
constexpr double kProportional = 1.0 - 1e-9;

bool has_one_channel(const Attachment& a) {
  return a.driven() && a.fit.model.joints.size() == 1 &&
         a.fit.model.joints.front().terms.size() == 1;
}

// The same motion by another channel that is a multiple of its own.
ChainFit by_channel(ChainFit fit, int channel, double product) {
  ChainTerm& term = fit.model.joints.front().terms.front();
  term = {channel, std::copysign(term.scale, term.scale * product)};
  return fit;
}

bool is_declared(const Readings& readings, const Attachment& a) {
  const ChannelUnit unit = readings.unit(a.channel());
  return unit == ChannelUnit::kRadian || unit == ChannelUnit::kMetre;
}

}  // namespace

bool share_a_channel(const Attachment& a, const Attachment& b, const Readings& readings) {
  for (const Attachment* one : {&a, &b}) {
    if (!one->driven() || one->fit.model.joints.size() != 1 || !one->leaves_noise_only())
      return false;
  }
  if (a.channel() != b.channel()) return false;
  const ChannelUnit unit = readings.unit(a.channel());
  const JointType type_a = a.fit.model.joints.front().type;
  const JointType type_b = b.fit.model.joints.front().type;
  const double scale_a = std::abs(scale_of(a.fit, readings));
  const double scale_b = std::abs(scale_of(b.fit, readings));
  return (is_natural(type_a, scale_a, unit) && is_natural(type_b, scale_b, unit)) ||
         (type_a == type_b && std::abs(scale_a - scale_b) < kClose * scale_b);
}

GrownTree in_natural_units(GrownTree tree, const Series& series, const Readings& readings) {
  for (std::size_t l = 1; l < tree.links.size(); ++l) {
    if (!is_odd(tree.links[l].attachment, readings)) continue;
    const std::size_t founder = tree.founder_of(static_cast<int>(l));
    const Attachment before = tree.links[l].attachment;
    std::optional<Attachment> other = as_other_type(before, series.bodies[founder],
                                                    tree.link(tree.links[l].parent).path, readings);
    if (!other) continue;
    tree.links[l].attachment = std::move(*other);
    std::erase_if(tree.bodies[founder].alternatives, [&](const Attachment& a) {
      return a.parent == before.parent && a.channel() == before.channel();
    });
    tree = refit_tree(tree, series, readings);
  }
  return tree;
}

std::vector<Exchange> possible_exchanges(const GrownTree& tree, const Readings& readings) {
  std::vector<Exchange> out;
  for (int l = 1; l < static_cast<int>(tree.links.size()); ++l) {
    for (int m = l + 1; m < static_cast<int>(tree.links.size()); ++m) {
      const Attachment& a = tree.link(l).attachment;
      const Attachment& b = tree.link(m).attachment;
      if (!has_one_channel(a) || !has_one_channel(b) || a.channel() == b.channel()) continue;
      const double product = channel_correlation(readings, a.channel(), b.channel());
      if (std::abs(product) < kProportional) continue;
      const double now = penalty_of(a.fit, readings) + penalty_of(b.fit, readings);
      const double then = penalty_of(by_channel(a.fit, b.channel(), product), readings) +
                          penalty_of(by_channel(b.fit, a.channel(), product), readings);
      out.push_back({.first_link = l,
                     .second_link = m,
                     .loss = then - now,
                     .declared = is_declared(readings, a) && is_declared(readings, b)});
    }
  }
  return out;
}

GrownTree with_likely_exchanges(GrownTree tree, const Readings& readings) {
  // Every exchange lowers the cost.
  constexpr double kLeast = -1e-6;
  while (true) {
    const std::vector<Exchange> all = possible_exchanges(tree, readings);
    const auto best = std::ranges::min_element(all, {}, &Exchange::loss);
    if (best == all.end() || best->loss > kLeast) return tree;
    Attachment& a = tree.link(best->first_link).attachment;
    Attachment& b = tree.link(best->second_link).attachment;
    const int of_a = a.channel();
    const double product = channel_correlation(readings, of_a, b.channel());
    a.fit = by_channel(std::move(a.fit), b.channel(), product);
    b.fit = by_channel(std::move(b.fit), of_a, product);
    for (Attachment* changed : {&a, &b}) changed->penalty = penalty_of(changed->fit, readings);
    tree.bodies[tree.founder_of(best->first_link)].attachment = a;
    tree.bodies[tree.founder_of(best->second_link)].attachment = b;
  }
}

}  // namespace kinescope::structure_search
