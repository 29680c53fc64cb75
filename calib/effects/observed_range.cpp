// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/observed_range.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

namespace kinescope {
namespace {

bool depends_on_value(const EffectId& id) {
  constexpr std::array<std::string_view, 10> kOfValue{
      "encoder_scale", "eccentricity", "gear_error",    "backlash",    "compliance",
      "coupling",      "helical",      "curved_slider", "axis_wobble", "joint_map"};
  return std::ranges::find(kOfValue, id.effect) != kOfValue.end();
}

bool repeats_every_turn(const EffectId& id) {
  return id.effect == "eccentricity" || id.effect == "axis_wobble";
}

}  // namespace

std::optional<JointId> deciding_joint(const FittedEffect& effect, const KinematicTree& tree) {
  if (!depends_on_value(effect.id)) return std::nullopt;
  const std::optional<JointId> own = tree.joint(effect.id.place);
  if (!own || effect.id.effect != "coupling") return own;
  const double other = std::round(effect.scan);
  if (!(other >= 0.0 && other < static_cast<double>(tree.joints.size()))) return std::nullopt;
  return JointId{static_cast<int>(other)};
}

std::optional<JointLimits> observed_range(const FittedEffect& effect,
                                          const KinematicTree& calibrated) {
  const auto joint = deciding_joint(effect, calibrated);
  return joint ? calibrated.joints[joint->index()].limits : std::nullopt;
}

double beyond_range(const FittedEffect& effect, double value) {
  if (!effect.range) return 0.0;
  constexpr double kFullTurn = 2.0 * std::numbers::pi;
  const auto& [lower, upper] = *effect.range;
  if (repeats_every_turn(effect.id)) {
    const double middle = 0.5 * (lower + upper);
    if (value < lower || value > upper) value = middle + std::remainder(value - middle, kFullTurn);
  }
  return std::max({0.0, lower - value, value - upper});
}

double range_weight(const FittedEffect& effect, double value) {
  const double distance = beyond_range(effect, value);
  if (distance == 0.0) return 1.0;
  const double reach = kFadeShare * (effect.range->upper - effect.range->lower);
  if (!(distance < reach)) return 0.0;
  const double s = distance / reach;
  return 1.0 - s * s * (3.0 - 2.0 * s);
}

}  // namespace kinescope
