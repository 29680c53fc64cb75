// SPDX-License-Identifier: Apache-2.0
#include "app/explain/own_units.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/explain/declared.h"
#include "kinematics/core/error.h"
#include "kinematics/model/usual_unit.h"
#include "kinematics/model/values_on_drawing.h"

namespace kinescope {
namespace {

bool is_declared(const Recording& recording, const std::string& channel, bool as_ticks) {
  const auto unit = recording.settings.units.find(channel);
  return unit != recording.settings.units.end() && (unit->second == "ticks") == as_ticks;
}

// The joint of what was found that a column drives, and no other column with it.
const Joint* driven_by(const KinematicTree& found, const std::string& channel) {
  const Joint* out = nullptr;
  for (const Joint& joint : found.joints) {
    if (joint.channel != channel) continue;
    if (out != nullptr || !joint.couplings.empty()) return nullptr;
    out = &joint;
  }
  return out;
}

// What a lens does to the scales of a log in rad is no unit of its own.
bool counts_in_its_own(const Recording& recording, const Joint& found) {
  if (is_declared(recording, found.channel, true)) return true;
  return !is_declared(recording, found.channel, false) &&
         !usual_unit(found.type, std::abs(found.scale), kHingeTolerance);
}

// Of the movable joints, in the order of the drawing. Nothing where other joints were found.
std::vector<const Joint*> found_as_drawn(const KinematicTree& found, const KinematicTree& drawn) {
  std::vector<const Joint*> out;
  for (const Joint& joint : drawn.joints) {
    if (!is_movable(joint)) continue;
    const Joint* one = joint.channel.empty() ? nullptr : driven_by(found, joint.channel);
    if (one == nullptr || one->type != joint.type) return {};
    out.push_back(one);
  }
  return std::cmp_equal(out.size(), std::ranges::count_if(found.joints, is_movable))
             ? out
             : std::vector<const Joint*>();
}

std::vector<PlacedAxis> axes_at_zero(const KinematicTree& tree, std::vector<JointId>& joints) {
  return placed_axes(tree, Eigen::VectorXd::Zero(std::ssize(tree.joints)), joints);
}

// The axes of these joints, in their order, with the parents that the drawing has.
std::vector<PlacedAxis> axes_of(const KinematicTree& found, const std::vector<const Joint*>& order,
                                const std::vector<PlacedAxis>& drawn) {
  std::vector<JointId> joints;
  const std::vector<PlacedAxis> all = axes_at_zero(found, joints);
  std::vector<PlacedAxis> out;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const auto at = std::ranges::find_if(
        joints, [&](JointId id) { return &found.joints[id.index()] == order[k]; });
    out.push_back(all[static_cast<std::size_t>(at - joints.begin())]);
    out.back().parent = drawn[k].parent;
  }
  return out;
}

double middle_of(const JointLog& log, const std::string& channel) {
  const auto values = log.values.col(value_of(log.channel(channel)));
  return 0.5 * (values.minCoeff() + values.maxCoeff());
}

// By which a joint's values are farther than half a turn from the middle of its limits; rad.
double whole_turns(const Joint& joint, double middle) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double drawn = joint.limits ? 0.5 * (joint.limits->lower + joint.limits->upper) : 0.0;
  return kTurn * std::round((middle + joint.offset - drawn) / kTurn);
}

std::string in_words(const std::vector<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

NominalChannels with_own_units(NominalChannels matched, const Structure& structure,
                               const Recording& recording) {
  const KinematicTree found = structure.status == StructureStatus::kDetermined
                                  ? structure_tree(structure, recording.log)
                                  : KinematicTree();
  std::vector<std::string> own;
  for (const Joint& joint : matched.tree.joints) {
    if (!is_movable(joint) || joint.channel.empty()) continue;
    const Joint* one = driven_by(found, joint.channel);
    if (one != nullptr ? counts_in_its_own(recording, *one)
                       : is_declared(recording, joint.channel, true))
      own.push_back(joint.channel);
  }
  if (own.empty()) return matched;
  const std::vector<const Joint*> order = found_as_drawn(found, matched.tree);
  if (order.empty()) {
    throw undetermined(
        recording.log.source,
        fmt::format(
            "'{}' count{} in units of {} own, and the markers do not show by themselves all "
            "joints that are drawn: what one is stays open",
            fmt::join(own, "', '"), own.size() == 1 ? "s" : "", own.size() == 1 ? "its" : "their"),
        "fix a marker to every link, or log rad and m; kinescope run without --nominal shows which "
        "joints the markers tell");
  }
  std::vector<JointId> joints;
  const std::vector<PlacedAxis> drawn = axes_at_zero(matched.tree, joints);
  std::vector<bool> is_open;
  for (const JointId id : joints)
    is_open.push_back(std::ranges::find(own, matched.tree.joints[id.index()].channel) != own.end());
  const std::vector<ValueOnDrawing> values =
      values_on_drawing(axes_of(found, order, drawn), drawn, is_open);
  std::vector<std::string> directions;
  std::vector<std::string> zeros;
  for (std::size_t k = 0; k < joints.size(); ++k) {
    if (!is_open[k]) continue;
    Joint& joint = matched.tree.joints[joints[k].index()];
    const ValueOnDrawing& value = values[k];
    const Joint& shown = *order[k];
    joint.scale = value.direction * shown.scale;
    const double middle = joint.scale * middle_of(recording.log, joint.channel);
    joint.offset = value.zero_told ? value.direction * shown.offset + value.zero : -middle;
    if (joint.type == JointType::kRevolute) joint.offset -= whole_turns(joint, middle);
    if (!value.direction_told) directions.push_back(joint.channel);
    if (!value.zero_told) zeros.push_back(joint.channel);
  }
  std::string words = fmt::format(
      "{} count{} in units of {} own: what one of them is, which way and from where it counts is "
      "taken from the axes of the nominal robot",
      in_words(own), own.size() == 1 ? "s" : "", own.size() == 1 ? "its" : "their");
  if (!directions.empty())
    words += fmt::format("; which way {} count{} they do not tell: as drawn", in_words(directions),
                         directions.size() == 1 ? "s" : "");
  if (!zeros.empty())
    words += fmt::format(
        "; where {} {} zero they do not tell: in the middle of the range that was logged",
        in_words(zeros), zeros.size() == 1 ? "is" : "are");
  matched.warnings.push_back(std::move(words));
  return matched;
}

}  // namespace kinescope
