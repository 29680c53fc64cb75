// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/corrected_log.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "calib/effects/camera_effects.h"
#include "calib/effects/joint_shares.h"
#include "calib/effects/observed_range.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

effects::EffectWorld world_of(const JointLog& log, const KinematicTree& tree,
                              const std::optional<Eigen::Vector3d>& gravity_base) {
  effects::EffectWorld world;
  world.tree = tree;
  world.frames = effects::motion_of(log, tree);
  world.log = world.frames;
  world.loaded = world.frames;
  world.gravity_base = gravity_base;
  world.known = true;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    if (log.channel(tree.joints[j].channel)) world.driven.push_back(static_cast<int>(j));
  }
  world.moving = world.driven;
  return world;
}

// True when the correction is one of the joint's value, and of nothing else.
bool is_joint_value(const Correction& correction, const Joint& joint) {
  if (correction.part == CorrectedPart::kClock) return true;
  if (correction.part != CorrectedPart::kJoint || correction.twists.rows() > 0) return false;
  const bool turns = joint.type == JointType::kRevolute;
  return turns ? correction.direction.tail<3>().isZero(0.0)
               : correction.direction.head<3>().isZero(0.0);
}

// Moves the stamps to the camera's clock; false for other effects.
bool undo_clock(const FittedEffect& effect, JointLog& log) {
  if (effects::is_clock_offset(effect.id)) {
    for (double& t : log.times_s) t -= effect.values[0];
    return true;
  }
  if (effect.id.effect != "clock_drift") return false;
  // The log's clock is ahead by drift x (camera's time - reference).
  const double drift = effect.values[0];
  for (double& t : log.times_s) t -= drift / (1.0 + drift) * (t - effect.references[0]);
  return true;
}

Error refused(const JointLog& log, const FittedEffect& effect, const std::string& what) {
  return bad_input(log.source.empty() ? "the joint log" : log.source,
                   fmt::format("{} at {}: {}", effect.id.effect, effect.id.place, what),
                   "give a log with the channels of the recording, and the run's own results");
}

// Throws unless the log says where the joint is.
void require_channels(const FittedEffect& effect, const Joint& joint, const JointLog& log) {
  std::vector<std::string> channels{joint.channel};
  for (const ChannelShare& share : joint.couplings) channels.push_back(share.channel);
  for (const std::string& channel : channels) {
    if (!log.channel(channel)) throw refused(log, effect, fmt::format("no column '{}'", channel));
  }
}

// True where the other joint turns what a joint carries, or the joint itself.
bool moves_load_of(const KinematicTree& tree, JointId joint, const Joint& other) {
  const auto behind = [&tree](JointId first, LinkId link) {
    const std::vector<JointId> path = tree.path_to(link);
    return std::ranges::find(path, first) != path.end();
  };
  return behind(joint, other.child) ||
         behind(*tree.parent_joint(other.child), tree.joints[joint.index()].child);
}

// Throws for an effect at a joint that is not there.
void check_place(const FittedEffect& effect, const KinematicTree& tree, const JointLog& log) {
  constexpr std::array<std::string_view, 15> kElsewhere{
      "rolling_shutter", "lens_distortion", "intrinsics",       "blooming",     "tag_size",
      "bent_tag",        "tag_slip",        "camera_bump",      "camera_drift", "thermal_growth",
      "clock_jump",      "recording_mount", "recording_growth", "focal_jump",   "focal_drift"};
  if (std::ranges::find(kElsewhere, effect.id.effect) != kElsewhere.end()) return;
  const auto joint = tree.joint(effect.id.place);
  if (!joint) throw refused(log, effect, "the robot has no such joint");
  require_channels(effect, tree.joints[joint->index()], log);
  if (const auto decides = deciding_joint(effect, tree))
    require_channels(effect, tree.joints[decides->index()], log);
  if (effect.id.effect == "early_reading") {
    for (const std::string& column : tree.joints[joint->index()].copies) {
      if (!log.channel(column)) throw refused(log, effect, fmt::format("no column '{}'", column));
    }
  }
  if (!effects::is_sag(effect.id)) return;
  for (const Joint& other : tree.joints) {
    if (!other.channel.empty() && moves_load_of(tree, *joint, other))
      require_channels(effect, other, log);
  }
}

// True where the joint's channel drives a second one, which has no part in the effect.
bool drives_another(const KinematicTree& tree, const Joint& joint) {
  return std::ranges::count(tree.joints, joint.channel, &Joint::channel) > 1;
}

// Joints that follow a channel by design followed the reading, not what it lacked: their own
// channels take back what the change would do to them.
void hold_followers(const KinematicTree& tree, const Joint& changed, const Eigen::VectorXd& change,
                    JointLog& corrected) {
  for (const Joint& joint : tree.joints) {
    const auto own = corrected.channel(joint.channel);
    if (!own) continue;
    for (const ChannelShare& share : joint.couplings) {
      if (share.channel == changed.channel) corrected.values.col(*own) -= share.ratio * change;
    }
  }
}

// What the encoder of a joint did not show, in the unit of its value.
Eigen::VectorXd missing_value(const FittedEffect& effect,
                              const std::vector<Correction>& corrections,
                              const JointMotion& motion) {
  const Eigen::VectorXd value = motion.value.col(corrections.front().index);
  if (corrections.front().part == CorrectedPart::kClock) {
    std::vector<double> read_s = motion.times_s;
    for (double& t : read_s) t += effect.values[0];
    return effects::read_at(motion.times_s, value, read_s) - value;
  }
  Eigen::VectorXd out = Eigen::VectorXd::Zero(value.size());
  for (std::size_t k = 0; k < corrections.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    out +=
        effect.values[at] * corrections[k].reference / effect.references[at] * corrections[k].share;
  }
  return out;
}

// `missing` in the unit of the joint's value. False where the channel drives a second joint.
bool add_to_channel(const Eigen::VectorXd& missing, const KinematicTree& tree, const Joint& joint,
                    const JointLog& log, JointLog& corrected) {
  if (drives_another(tree, joint)) return false;
  const Eigen::VectorXd change = missing / joint.scale;
  corrected.values.col(value_of(log.channel(joint.channel))) += change;
  hold_followers(tree, joint, change, corrected);
  return true;
}

/// What a joint's encoder did not show, in the unit of its value.
struct Missing {
  std::size_t joint = 0;
  Eigen::VectorXd value;  // instants
};

// Nothing for what no encoder shows. As if it had been observed everywhere.
std::optional<Missing> missing_everywhere(const FittedEffect& effect, const KinematicTree& tree,
                                          const std::vector<effects::CameraEffect>& library,
                                          const JointMotion& motion, const JointLog& log) {
  check_place(effect, tree, log);
  if (!effect.table.empty()) {
    const std::size_t j = value_of(tree.joint(effect.id.place)).index();
    const Eigen::VectorXd value = motion.value.col(static_cast<Eigen::Index>(j));
    return Missing{j, effect.table.at(value)};
  }
  const auto found = std::ranges::find_if(
      library, [&](const effects::CameraEffect& known) { return known.candidate.id == effect.id; });
  if (found == library.end()) return std::nullopt;
  const Candidate& candidate = found->candidate;
  if (candidate.scan_listed &&
      std::ranges::find(candidate.scan, effect.scan) == candidate.scan.end()) {
    throw refused(log, effect, "no column for what it follows");
  }
  const std::vector<Correction> corrections = found->corrections(effect.scan);
  const auto j = static_cast<std::size_t>(corrections.front().index);
  if (!is_joint_value(corrections.front(), tree.joints[j])) return std::nullopt;
  if (std::cmp_not_equal(corrections.size(), effect.values.size())) {
    throw refused(
        log, effect,
        fmt::format("{} numbers where it takes {}", effect.values.size(), corrections.size()));
  }
  return Missing{j, missing_value(effect, corrections, motion)};
}

// Values of the joint that an effect depends on; empty without a range to hold them against.
Eigen::VectorXd deciding_values(const FittedEffect& effect, const KinematicTree& tree,
                                const JointMotion& motion) {
  const auto joint = effect.range ? deciding_joint(effect, tree) : std::nullopt;
  if (!joint) return {};
  return motion.value.col(static_cast<Eigen::Index>(joint->index()));
}

// Nothing for what no encoder shows.
std::optional<Missing> missing_by(const FittedEffect& effect, const KinematicTree& tree,
                                  const std::vector<effects::CameraEffect>& library,
                                  const JointMotion& motion, const JointLog& log) {
  std::optional<Missing> out = missing_everywhere(effect, tree, library, motion, log);
  if (!out) return out;
  const Eigen::VectorXd values = deciding_values(effect, tree, motion);
  for (Eigen::Index i = 0; i < values.size(); ++i) out->value[i] *= range_weight(effect, values[i]);
  return out;
}

// Nothing where the log stays within the effect's range.
std::optional<FadedEffect> faded_part(const FittedEffect& effect, const KinematicTree& tree,
                                      const JointMotion& motion) {
  constexpr double kSame = 0.01;  // of the range; two drives of one path differ by as much
  const Eigen::VectorXd values = deciding_values(effect, tree, motion);
  if (values.size() == 0) return std::nullopt;
  const double least = kSame * (effect.range->upper - effect.range->lower);
  JointLimits reached = *effect.range;
  for (const double value : values) {
    if (!(beyond_range(effect, value) > least)) continue;
    reached.lower = std::min(reached.lower, value);
    reached.upper = std::max(reached.upper, value);
  }
  if (reached == *effect.range) return std::nullopt;
  return FadedEffect{effect.id, value_of(deciding_joint(effect, tree)), *effect.range, reached};
}

// The world of the log with the effects in it: loads where they leave the joints.
effects::EffectWorld world_with(const JointLog& log, const KinematicTree& tree,
                                const std::vector<FittedEffect>& effects,
                                const std::optional<Eigen::Vector3d>& gravity_base) {
  constexpr int kRounds = 3;  // each leaves of its error what the sag is, in rad
  effects::EffectWorld out = world_of(log, tree, gravity_base);
  if (std::ranges::any_of(effects, effects::is_of_reading, &FittedEffect::id))
    out.unsteady = effects::unsteady_readings(out.log, out.driven, false);
  for (const FittedEffect& effect : effects) {
    const auto joint = tree.joint(effect.id.place);
    if (joint && effects::is_bend(effect.id, effect.scan) && effect.values.size() == 2)
      out.bends.insert_or_assign(joint->value, Eigen::Vector2d(effect.values));
  }
  const bool under_load = std::ranges::any_of(
      effects, [](const FittedEffect& effect) { return effects::is_sag(effect.id); });
  for (int round = 0; under_load && round < kRounds; ++round) {
    const std::vector<effects::CameraEffect> library = effects::joint_effects(out);
    out.loaded.value = out.frames.value;
    for (const FittedEffect& effect : effects) {
      if (!tree.joint(effect.id.place)) continue;
      if (const auto missing = missing_by(effect, tree, library, out.frames, log))
        out.loaded.value.col(static_cast<Eigen::Index>(missing->joint)) += missing->value;
    }
  }
  return out;
}

}  // namespace

CorrectedLog corrected_log(const JointLog& log, const KinematicTree& tree,
                           const std::vector<FittedEffect>& effects,
                           const std::optional<Eigen::Vector3d>& gravity_base) {
  CorrectedLog out{log, {}, {}, {}};
  if (log.empty()) return out;
  const effects::EffectWorld world = world_with(log, tree, effects, gravity_base);
  const std::vector<effects::CameraEffect> library = effects::joint_effects(world);
  for (const FittedEffect& effect : effects) {
    bool undone = undo_clock(effect, out.log);
    if (!undone) {
      const auto missing = missing_by(effect, tree, library, world.frames, log);
      undone = missing &&
               add_to_channel(missing->value, tree, tree.joints[missing->joint], log, out.log);
      if (const auto faded = faded_part(effect, tree, world.frames); undone && faded)
        out.faded.push_back(*faded);
    }
    (undone ? out.undone : out.left).push_back(effect.id);
  }
  return out;
}

}  // namespace kinescope
