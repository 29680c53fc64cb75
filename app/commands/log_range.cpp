// SPDX-License-Identifier: Apache-2.0
#include "app/commands/log_range.h"

#include <cmath>
#include <optional>

#include <fmt/format.h>

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

}  // namespace

std::vector<std::string> range_warnings(const JointLog& in_si, const KinematicTree& tree,
                                        const CalibratedEffects& found) {
  std::vector<std::string> out;
  for (const JointChannel& joint : found.channels) {
    const auto range = range_in(in_si, joint, 1.0);
    if (!range || !joint.range || !(span(*joint.range) > 0.0)) continue;
    if (within(*range, *joint.range, kBeyond * span(*joint.range))) continue;
    const std::string words = fmt::format(
        "column '{}' takes {} from {:.4g} to {:.4g} {unit}, the run saw {:.4g} to {:.4g} {unit}",
        joint.channel, joint.joint, range->lower, range->upper, joint.range->lower,
        joint.range->upper, fmt::arg("unit", turns(tree, joint) ? "rad" : "m"));
    if (turns(tree, joint) && !found.unit_factors.contains(joint.channel) &&
        is_in_degrees(in_si, joint, *range)) {
      throw bad_input(in_si.source, words + ": these are degrees",
                      "give the column in rad, as in the recording");
    }
    out.push_back(fmt::format("{}: {}: what was found is not known there", in_si.source, words));
  }
  return out;
}

}  // namespace kinescope
