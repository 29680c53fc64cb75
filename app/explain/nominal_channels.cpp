// SPDX-License-Identifier: Apache-2.0
#include "app/explain/nominal_channels.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/explain/declared.h"
#include "app/io/nearest_name.h"
#include "kinematics/core/error.h"
#include "kinematics/model/usual_unit.h"
#include "kinematics/model/values_on_drawing.h"
#include "kinematics/structure/copied_channels.h"

namespace kinescope {
namespace {

bool is_movable(const Joint& joint) { return joint.type != JointType::kFixed; }

std::vector<std::string> quoted(const std::vector<std::string>& names) {
  std::vector<std::string> out;
  for (const std::string& name : names) out.push_back(fmt::format("'{}'", name));
  return out;
}

// Columns that move and are named like no joint.
std::vector<std::string> strangers(const JointLog& log, const KinematicTree& tree) {
  std::vector<std::string> out;
  for (std::size_t c = 0; c < log.channels.size(); ++c) {
    const auto joint = tree.joint(log.channels[c]);
    if (joint && is_movable(tree.joints[joint->index()])) continue;
    const auto values = log.values.col(static_cast<Eigen::Index>(c));
    const double range = values.maxCoeff() - values.minCoeff();
    if (range > 1e-9 * std::max(1.0, values.cwiseAbs().maxCoeff())) out.push_back(log.channels[c]);
  }
  return out;
}

std::vector<Joint*> joints_without_column(KinematicTree& tree) {
  std::vector<Joint*> out;
  for (Joint& joint : tree.joints)
    if (is_movable(joint) && joint.channel.empty()) out.push_back(&joint);
  return out;
}

Error no_names(const JointLog& log, const std::vector<std::string>& names) {
  return bad_input(log.source, "no column is named like a joint of the nominal robot",
                   fmt::format("name the columns {}", fmt::join(names, ", ")));
}

void take_in_order(const JointLog& log, NominalChannels& out) {
  const std::vector<Joint*> own = joints_without_column(out.tree);
  std::vector<std::string> names;
  for (const Joint* joint : own) names.push_back(joint->name);
  if (own.empty() || own.size() > log.channels.size()) throw no_names(log, names);
  for (std::size_t k = 0; k < own.size(); ++k) own[k]->channel = log.channels[k];
  out.in_order = true;
  out.of_more = own.size() < log.channels.size();
  out.warnings.push_back(
      out.of_more
          ? fmt::format("no column of {} is named like a joint of the nominal robot: `run` takes "
                        "those that the markers show to drive them, where they do",
                        log.source)
          : fmt::format("no column of {} is named like a joint of the nominal robot: taken in "
                        "order ({} drives {}, ..)",
                        log.source, log.channels.front(), names.front()));
}

// A joint that mimics another one names that one as its channel; it takes that one's column, or
// none where there is none.
void follow_others(const JointLog& log, KinematicTree& tree) {
  for (Joint& joint : tree.joints) {
    if (!is_movable(joint) || joint.channel.empty() || log.channel(joint.channel)) continue;
    const auto other = tree.joint(joint.channel);
    const std::string column = other ? tree.joints[other->index()].channel : std::string();
    joint.channel = log.channel(column) ? column : std::string();
    if (!joint.channel.empty()) continue;
    joint.scale = 1.0;
    joint.offset = 0.0;
  }
}

// What no joint is driven by and tells the same as what one is.
void list_copies(const JointLog& log, KinematicTree& tree) {
  const auto name = [&log](int c) { return log.channels[static_cast<std::size_t>(c)]; };
  const auto drives = [&tree](const std::string& column) {
    return std::ranges::find(tree.joints, column, &Joint::channel) != tree.joints.end();
  };
  for (const structure_search::SameQuantity& group : structure_search::same_quantities(log)) {
    for (Joint& joint : tree.joints) {
      if (std::ranges::none_of(group, [&](int c) { return name(c) == joint.channel; })) continue;
      for (const int c : group) {
        if (!drives(name(c))) joint.copies.push_back(name(c));
      }
    }
  }
}

bool moves_something_beyond(const KinematicTree& tree, std::size_t held) {
  const JointId id{static_cast<int>(held)};
  return std::ranges::any_of(tree.joints, [&](const Joint& joint) {
    if (!is_movable(joint) || joint.channel.empty()) return false;
    const std::vector<JointId> path = tree.path_to(joint.child);
    return std::ranges::find(path, id) != path.end();
  });
}

void hold_the_others(const JointLog& log, NominalChannels& out) {
  const std::vector<std::string> unknown = strangers(log, out.tree);
  std::vector<std::string> held;
  for (std::size_t j = 0; j < out.tree.joints.size(); ++j) {
    const Joint& joint = out.tree.joints[j];
    if (!is_movable(joint) || !joint.channel.empty()) continue;
    const std::string what =
        fmt::format("no column is named like the joint '{}' of the nominal robot", joint.name);
    if (!unknown.empty()) {
      throw bad_input(
          log.source,
          fmt::format("{}, and no joint like the column{} {}", what, unknown.size() == 1 ? "" : "s",
                      fmt::join(quoted(unknown), ", ")),
          "name the column of every joint like the joint; leave out columns of no joint");
    }
    if (moves_something_beyond(out.tree, j)) {
      throw bad_input(log.source, what + ", but joints beyond it are logged",
                      fmt::format("log it, or make it a fixed joint; {}",
                                  did_you_mean(joint.name, log.channels)));
    }
    held.push_back(joint.name);
  }
  if (held.empty()) return;
  out.warnings.push_back(fmt::format(
      "{} has no column for {} of the nominal robot: held at 0; a marker that moves with {} would "
      "spoil the fit",
      log.source, fmt::join(held, ", "), held.size() == 1 ? "it" : "them"));
}

// Each joint hangs on the one before it.
bool is_chain(const Structure& structure) {
  for (std::size_t k = 1; k < structure.joints.size(); ++k) {
    if (structure.joints[k].parent_link != structure.joints[k - 1].child_link) return false;
  }
  return true;
}

// The movable joints, first to last; nothing where they are no chain or one follows another.
std::vector<std::size_t> chain_of(const KinematicTree& tree) {
  std::vector<std::size_t> chain;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    if (!is_movable(tree.joints[j])) continue;
    const std::vector<JointId> path = tree.path_to(tree.joints[j].child);
    const auto on_path = [&](std::size_t k) {
      return std::ranges::find(path, JointId{static_cast<int>(k)}) != path.end();
    };
    if (!std::ranges::all_of(chain, on_path)) return {};
    chain.push_back(j);
  }
  std::set<std::string> channels;
  for (const std::size_t j : chain) channels.insert(tree.joints[j].channel);
  return channels.size() == chain.size() ? chain : std::vector<std::size_t>();
}

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

NominalChannels match_channels(const Recording& recording) {
  const JointLog& log = recording.log;
  if (log.empty()) {
    throw bad_input((recording.folder / "joints.csv").string(),
                    "no such file, which a nominal robot needs",
                    "record the joints, or leave --nominal out: the structure is then found from "
                    "the markers alone");
  }
  NominalChannels out{value_of(recording.nominal), {}};
  bool named = false;
  for (Joint& joint : out.tree.joints) {
    if (!is_movable(joint) || !log.channel(joint.name)) continue;
    joint.channel = joint.name;
    joint.scale = 1.0;
    joint.offset = 0.0;
    named = true;
  }
  if (!named) take_in_order(log, out);
  follow_others(log, out.tree);
  if (!out.of_more) list_copies(log, out.tree);
  hold_the_others(log, out);
  return out;
}

void require_columns_known(const NominalChannels& matched, const JointLog& log) {
  if (!matched.of_more) return;
  std::vector<std::string> names;
  for (const Joint& joint : matched.tree.joints)
    if (is_movable(joint)) names.push_back(joint.name);
  throw no_names(log, names);
}

NominalChannels by_motion(NominalChannels matched, const Structure& structure,
                          const JointLog& log) {
  const std::vector<std::size_t> chain = chain_of(matched.tree);
  if (structure.status != StructureStatus::kDetermined || !is_chain(structure) ||
      structure.joints.size() != chain.size()) {
    return matched;
  }
  std::vector<std::string> columns;
  std::vector<std::string> words;
  for (std::size_t k = 0; k < chain.size(); ++k) {
    const StructureJoint& found = structure.joints[k];
    const Joint& joint = matched.tree.joints[chain[k]];
    if (!found.channel || found.type != joint.type) return matched;
    columns.push_back(log.channels[static_cast<std::size_t>(found.channel->channel)]);
    words.push_back(fmt::format("{} drives {}", columns.back(), joint.name));
  }
  if (std::set<std::string>(columns.begin(), columns.end()).size() != columns.size()) {
    return matched;
  }
  for (std::size_t k = 0; k < chain.size(); ++k) {
    matched.tree.joints[chain[k]].channel = columns[k];
  }
  if (matched.of_more) list_copies(log, matched.tree);
  matched.of_more = false;
  matched.warnings = {
      fmt::format("no column of {} is named like a joint of the nominal robot: taken by what the "
                  "markers show ({})",
                  log.source, fmt::join(words, ", "))};
  return matched;
}

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
        fmt::format("{} count{} in units of {} own, and the markers do not show by themselves all "
                    "joints that are drawn: what one is stays open",
                    in_words(quoted(own)), own.size() == 1 ? "s" : "",
                    own.size() == 1 ? "its" : "their"),
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

void require_drawn_types(const NominalChannels& matched, const Structure& structure,
                         const Recording& recording) {
  if (structure.status != StructureStatus::kDetermined) return;
  std::vector<std::string> wrong;
  for (const StructureJoint& found : structure.joints) {
    if (!found.channel || !found.couplings.empty()) continue;
    const std::string& column =
        recording.log.channels[static_cast<std::size_t>(found.channel->channel)];
    for (const Joint& joint : matched.tree.joints) {
      if (!is_movable(joint) || joint.channel != column || joint.type == found.type) continue;
      const bool turns = found.type == JointType::kRevolute;
      wrong.push_back(fmt::format(
          "joint '{}' is drawn as {}, but the markers {} with its column "
          "'{}'",
          joint.name, turns ? "prismatic" : "revolute", turns ? "turn" : "slide", column));
    }
  }
  if (wrong.empty()) return;
  throw undetermined(
      recording.nominal_file.string(), fmt::format("{}", fmt::join(wrong, "; ")),
      wrong.size() == 1
          ? "correct its type; kinescope run without --nominal shows what each column moves"
          : "are their columns exchanged? kinescope run without --nominal shows what each column "
            "moves");
}

}  // namespace kinescope
