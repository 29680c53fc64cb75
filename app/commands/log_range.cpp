// SPDX-License-Identifier: Apache-2.0
#include "app/commands/log_range.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kBeyond = 0.1;  // of the span seen; less is the scatter of two drives of one path

double span(const JointLimits& range) { return range.upper - range.lower; }

// The joint's values over the log, its readings times `factor`.
std::optional<JointLimits> range_in(const JointLog& log, const JointChannel& joint, double factor) {
  const auto own = log.channel(joint.channel);
  if (!own || log.empty()) return std::nullopt;
  Eigen::VectorXd reading = log.values.col(*own);
  for (const ChannelShare& share : joint.couplings) {
    const auto other = log.channel(share.channel);
    if (!other) return std::nullopt;
    reading += share.ratio * log.values.col(*other);
  }
  const Eigen::VectorXd value = (joint.scale * factor * reading.array() + joint.offset).matrix();
  return JointLimits{value.minCoeff(), value.maxCoeff()};
}

bool within(const JointLimits& range, const JointLimits& seen, double margin) {
  return range.lower >= seen.lower - margin && range.upper <= seen.upper + margin;
}

// Readings in rad were seen, and these span about 180 / pi times as much, around the same place.
// Another motion has another span: half as much to half as much again.
bool is_in_degrees(const JointLog& log, const JointChannel& joint, const JointLimits& range) {
  if (std::abs(joint.scale) < 0.4 || std::abs(joint.scale) > 2.5) return false;  // no rad: ticks
  const double ratio = span(range) / span(value_of(joint.range)) * kRadPerDegree;
  if (!(ratio > 0.5 && ratio < 1.5)) return false;
  const auto in_rad = range_in(log, joint, kRadPerDegree);
  return in_rad && within(*in_rad, *joint.range, 0.5 * span(*joint.range));
}

bool turns(const KinematicTree& tree, const JointChannel& joint) {
  const auto id = tree.joint(joint.joint);
  return id && tree.joints[id->index()].type == JointType::kRevolute;
}

const char* unit_of(const Joint& joint) { return joint.type == JointType::kRevolute ? "rad" : "m"; }

// "q2 moves to 1.93 rad, beyond the -0.8 to 1.7 rad in which gear_error at q2 was seen". All
// effects of a run have one range at a joint; those that repeat every turn are left less far.
std::string faded_words(const Joint& joint, std::span<const FadedEffect> faded) {
  const JointLimits& range = faded.front().range;
  JointLimits reached = faded.front().reached;
  std::vector<std::string> names;
  for (const FadedEffect& effect : faded) {
    reached.lower = std::min(reached.lower, effect.reached.lower);
    reached.upper = std::max(reached.upper, effect.reached.upper);
    names.push_back(fmt::format("{} at {}", effect.id.effect, effect.id.place));
  }
  const bool below = reached.lower < range.lower;
  const bool above = reached.upper > range.upper;
  const std::string way = below && above
                              ? fmt::format("from {:.4g} to {:.4g}", reached.lower, reached.upper)
                              : fmt::format("to {:.4g}", below ? reached.lower : reached.upper);
  return fmt::format("{} moves {} {unit}, beyond the {:.4g} to {:.4g} {unit} in which {} {} seen",
                     joint.name, way, range.lower, range.upper, fmt::join(names, ", "),
                     names.size() == 1 ? "was" : "were", fmt::arg("unit", unit_of(joint)));
}

std::vector<FadedEffect> faded_by(const KinematicTree& tree, const std::string& joint,
                                  const std::vector<FadedEffect>& faded) {
  std::vector<FadedEffect> out;
  std::ranges::copy_if(faded, std::back_inserter(out), [&](const FadedEffect& effect) {
    return tree.joints[effect.joint.index()].name == joint;
  });
  return out;
}

// What the run has not seen of a joint, in words; nothing where it goes hardly farther.
std::optional<std::string> unseen_words(const JointLog& in_si, const KinematicTree& tree,
                                        const JointChannel& joint, const CalibratedEffects& found) {
  const auto range = range_in(in_si, joint, 1.0);
  if (!range || !joint.range || !(span(*joint.range) > 0.0)) return std::nullopt;
  if (within(*range, *joint.range, kBeyond * span(*joint.range))) return std::nullopt;
  std::string words = fmt::format(
      "column '{}' takes {} from {:.4g} to {:.4g} {unit}, the run saw {:.4g} to {:.4g} {unit}",
      joint.channel, joint.joint, range->lower, range->upper, joint.range->lower,
      joint.range->upper, fmt::arg("unit", turns(tree, joint) ? "rad" : "m"));
  if (turns(tree, joint) && !found.unit_factors.contains(joint.channel) &&
      is_in_degrees(in_si, joint, *range)) {
    throw bad_input(in_si.source, words + ": these are degrees",
                    "give the column in rad, as in the recording");
  }
  return words;
}

}  // namespace

std::vector<std::string> range_warnings(const JointLog& in_si, const KinematicTree& tree,
                                        const CalibratedEffects& found,
                                        const std::vector<FadedEffect>& faded) {
  std::vector<std::string> out;
  for (const JointChannel& joint : found.channels) {
    const auto unseen = unseen_words(in_si, tree, joint, found);
    if (const auto of_joint = faded_by(tree, joint.joint, faded); !of_joint.empty()) {
      out.push_back(
          fmt::format("{}: {}: faded out there", in_si.source,
                      faded_words(tree.joints[of_joint.front().joint.index()], of_joint)));
    } else if (unseen) {
      out.push_back(
          fmt::format("{}: {}: what was found is not known there", in_si.source, *unseen));
    }
  }
  return out;
}

}  // namespace kinescope
