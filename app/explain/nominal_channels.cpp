// SPDX-License-Identifier: Apache-2.0
#include "app/explain/nominal_channels.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/nearest_name.h"
#include "kinematics/core/error.h"
#include "kinematics/structure/copied_channels.h"

namespace kinescope {
namespace {

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
