// SPDX-License-Identifier: Apache-2.0
#include "app/explain/declared.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// A slide's scale may be the tags' size; a hinge's cannot, and is an effect of the robot within
// kHingeTolerance.
constexpr double kSlideTolerance = 0.05;
constexpr double kClearSigmas = 4.0;

bool has_answer(const Structure& structure) {
  return structure.status == StructureStatus::kDetermined ||
         structure.status == StructureStatus::kAmbiguous;
}

std::string settings_file(const Recording& recording) {
  return (recording.folder / "recording.yaml").string();
}

// How many times as far as its declaration says a channel moves its joint; nothing where it says
// nothing of this joint. The reader brings channels to rad and m.
std::optional<double> times_as_far(JointType type, const std::string& unit, double scale) {
  const bool angle = unit == "rad" || unit == "deg";
  const bool length = unit == "m" || unit == "mm";
  const bool alike = type == JointType::kRevolute ? angle : length;
  return alike ? std::optional<double>(std::abs(scale)) : std::nullopt;
}

// As it stands in the file: the reader has brought deg and mm to rad and m.
std::string declared_word(const Recording& recording, const std::string& channel,
                          const std::string& unit) {
  if (!recording.log.unit_factors.contains(channel)) return unit;
  return unit == "rad" ? "deg" : "mm";
}

// Readings that are those of the joint in rad or m as they stand, declared as of the other kind. A
// turning channel that slides a joint, or the other way round, has a scale of its own (a spindle, a
// lever), but no robot's is one metre, or one rad a mm, to 5 %.
void refuse_other_kind(const Recording& recording, const StructureJoint& joint,
                       const std::string& channel, const std::string& declared, double scale) {
  const auto read = recording.log.unit_factors.find(channel);
  const double factor = read == recording.log.unit_factors.end() ? 1.0 : read->second;
  if (std::abs(std::abs(scale) * factor - 1.0) > kSlideTolerance) return;
  const bool turns = joint.type == JointType::kRevolute;
  throw undetermined(
      settings_file(recording),
      fmt::format("the channel '{}', declared in {}, {} its joint: its readings are in {}", channel,
                  declared_word(recording, channel, declared), turns ? "turns" : "slides",
                  turns ? "rad" : "m"),
      fmt::format("declare it in {}; a channel in units of its own is declared as ticks",
                  turns ? "rad" : "m"));
}

void check_scale(const Recording& recording, const StructureJoint& joint) {
  const ChannelTerm& term = value_of(joint.channel);
  const std::string& channel = recording.log.channels[static_cast<std::size_t>(term.channel)];
  const auto declared = recording.settings.units.find(channel);
  if (declared == recording.settings.units.end()) return;
  const std::string& unit = declared->second;
  if (unit == "ticks") return;
  const auto ratio = times_as_far(joint.type, unit, term.scale);
  if (!ratio) {
    refuse_other_kind(recording, joint, channel, unit, term.scale);
    return;
  }
  const double off = std::abs(*ratio - 1.0);
  const bool slides = joint.type == JointType::kPrismatic;
  if (off < (slides ? kSlideTolerance : kHingeTolerance) || off < kClearSigmas * term.scale_sigma) {
    return;
  }
  throw undetermined(
      settings_file(recording),
      fmt::format("the channel '{}', declared in {}, moves its joint {:.3g} times as far as that",
                  channel, declared_word(recording, channel, unit), *ratio),
      fmt::format(
          "{}; a channel in units of its own is declared as ticks",
          slides ? "check the size of the tags in tags.yaml, and the unit" : "check the unit"));
}

const StructureJoint* joint_of(const Structure& structure, TagId id) {
  for (const StructureJoint& joint : structure.joints) {
    const auto& markers = structure.links[static_cast<std::size_t>(joint.child_link)].markers;
    if (std::ranges::find(markers, id) != markers.end()) return &joint;
  }
  return nullptr;
}

Error moves(const Recording& recording, TagId id, const std::string& how) {
  return undetermined(settings_file(recording),
                      fmt::format("fixed_tags names {}, but that marker moves{}", id.value, how),
                      "take it out of fixed_tags, or hold it still and record again");
}

Error not_seen(const Recording& recording, TagId id) {
  return bad_input(settings_file(recording),
                   fmt::format("fixed_tags names {}, which is not seen", id.value),
                   "correct the id, or keep the marker in view");
}

}  // namespace

bool is_declared_in_si(const Recording& recording, const Joint& joint) {
  const auto declared = recording.settings.units.find(joint.channel);
  return declared != recording.settings.units.end() &&
         times_as_far(joint.type, declared->second, joint.scale).has_value();
}

std::map<std::string, ChannelUnit> declared_units(const Recording& recording) {
  std::map<std::string, ChannelUnit> units;
  // The reader has brought deg and mm to rad and m.
  for (const auto& [channel, unit] : recording.settings.units) {
    units[channel] = unit == "rad" ? ChannelUnit::kRadian
                     : unit == "m" ? ChannelUnit::kMetre
                                   : ChannelUnit::kTicks;
  }
  return units;
}

void require_declared_units(const Recording& recording, const Structure& structure) {
  if (!has_answer(structure)) return;
  for (const StructureJoint& joint : structure.joints) {
    if (joint.channel) check_scale(recording, joint);
  }
}

void require_fixed_tags(const Recording& recording, const Structure& structure) {
  if (!has_answer(structure)) return;
  const std::vector<TagId>& at_rest = structure.links.front().markers;
  for (const TagId id : recording.settings.fixed_tags) {
    if (std::ranges::find(at_rest, id) != at_rest.end()) continue;
    if (const StructureJoint* joint = joint_of(structure, id)) {
      throw moves(
          recording, id,
          joint->channel
              ? fmt::format(
                    " with '{}'",
                    recording.log.channels[static_cast<std::size_t>(joint->channel->channel)])
              : std::string());
    }
    const auto& free = structure.free_markers;
    if (std::ranges::find(free, id) != free.end()) throw moves(recording, id, "");
    throw not_seen(recording, id);
  }
}

void require_fixed_tags(const Recording& recording, const KinematicTree& tree) {
  for (const TagId id : recording.settings.fixed_tags) {
    const Marker* marker = tree.marker(id);
    if (marker == nullptr) throw not_seen(recording, id);
    const bool carried = std::ranges::any_of(tree.path_to(marker->link), [&](JointId joint) {
      return is_movable(tree.joints[joint.index()]);
    });
    if (!carried) continue;
    throw moves(recording, id,
                fmt::format(" with the link '{}'", tree.links[marker->link.index()].name));
  }
}

}  // namespace kinescope
