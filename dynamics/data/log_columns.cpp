// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/log_columns.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"
#include "kinematics/log/header_units.h"

namespace kinescope {
namespace {

using Key = std::vector<std::string>;

/// `pattern` holds at most one '*'.
bool fits(std::string_view pattern, std::string_view name) {
  const std::size_t star = pattern.find('*');
  if (star == std::string_view::npos) return pattern == name;
  const std::string_view head = pattern.substr(0, star);
  const std::string_view tail = pattern.substr(star + 1);
  return name.size() >= head.size() + tail.size() && name.starts_with(head) && name.ends_with(tail);
}

SignalColumns listed_signal(const ChannelTable& table, const std::vector<std::string>& listed,
                            LoggedQuantity quantity) {
  SignalColumns out;
  out.quantity = quantity;
  out.named = true;
  for (const std::string& pattern : listed) {
    const std::size_t before = out.columns.size();
    const bool whole_name = std::ranges::find(table.names, pattern) != table.names.end();
    for (std::size_t c = 0; c < table.names.size(); ++c) {
      const bool without = !whole_name && without_unit(table.names[c]) == pattern;
      if (!without && !fits(pattern, table.names[c])) continue;
      const std::optional<ColumnMeaning> meaning = read_column_name(table.names[c]);
      out.columns.push_back(static_cast<Eigen::Index>(c));
      out.keys.push_back(meaning ? meaning->joint : words_of(table.names[c]));
      out.units.push_back(meaning ? meaning->unit : "");
      if (quantity == LoggedQuantity::kTorque && meaning &&
          meaning->quantity == LoggedQuantity::kCurrent) {
        out.quantity = LoggedQuantity::kCurrent;
      }
    }
    if (out.columns.size() == before) {
      throw bad_request(fmt::format("{}:{}", table.source, table.header_line),
                        fmt::format("no column '{}' for the {}", pattern, to_string(quantity)),
                        fmt::format("the columns are {}", fmt::join(table.names, ", ")));
    }
  }
  return out;
}

SignalColumns named_signal(const ChannelTable& table, LoggedQuantity quantity,
                           LoggedOrigin origin) {
  SignalColumns out;
  out.quantity = quantity;
  out.origin = origin;
  std::set<Key> seen;
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    const std::optional<ColumnMeaning> meaning = read_column_name(table.names[c]);
    if (!meaning || meaning->quantity != quantity || meaning->origin != origin) continue;
    if (!seen.insert(meaning->joint).second) continue;
    out.columns.push_back(static_cast<Eigen::Index>(c));
    out.keys.push_back(meaning->joint);
    out.units.push_back(meaning->unit);
  }
  return out;
}

Key without_joint(Key key) {
  std::erase(key, "joint");
  return key;
}

/// Each key without the words that all of them have.
std::vector<Key> without_common(const std::vector<Key>& keys) {
  std::vector<Key> out;
  for (const Key& key : keys) {
    Key rest;
    for (const std::string& word : key) {
      const bool common = std::ranges::all_of(
          keys, [&](const Key& other) { return std::ranges::find(other, word) != other.end(); });
      if (!common || keys.size() == 1) rest.push_back(word);
    }
    out.push_back(rest);
  }
  return out;
}

std::optional<int> number_of(const Key& key) {
  if (key.size() != 1) return std::nullopt;
  int value = 0;
  const auto [end, error] = std::from_chars(key[0].data(), key[0].data() + key[0].size(), value);
  if (error != std::errc{} || end != key[0].data() + key[0].size()) return std::nullopt;
  return value;
}

/// The place of every wanted key among `keys`; nothing unless all are found, each once.
std::optional<std::vector<std::size_t>> equal_keys(const std::vector<Key>& keys,
                                                   const std::vector<Key>& wanted) {
  std::vector<std::size_t> order;
  for (const Key& want : wanted) {
    if (std::ranges::count(keys, want) != 1 || std::ranges::count(wanted, want) != 1) return {};
    order.push_back(static_cast<std::size_t>(std::ranges::find(keys, want) - keys.begin()));
  }
  return order;
}

/// Counted from 0 in the log and from 1 in the tree, or the other way.
std::optional<std::vector<std::size_t>> shifted_numbers(const std::vector<Key>& keys,
                                                        const std::vector<Key>& wanted) {
  if (keys.size() != wanted.size()) return {};
  for (const int shift : {-1, 1}) {
    std::vector<Key> shifted;
    for (const Key& want : wanted) {
      const std::optional<int> number = number_of(want);
      if (!number) return {};
      shifted.push_back({std::to_string(*number + shift)});
    }
    if (const auto order = equal_keys(keys, shifted)) return order;
  }
  return {};
}

std::vector<Key> wanted_keys(const std::vector<WantedJoint>& wanted, const LogMapping& mapping) {
  std::vector<Key> out;
  for (const WantedJoint& joint : wanted) {
    const auto named = mapping.joints.find(joint.name);
    out.push_back(
        without_joint(words_of(named == mapping.joints.end() ? joint.name : named->second)));
  }
  return out;
}

}  // namespace

std::string key_text(const Key& key) {
  return key.empty() ? "q" : fmt::format("{}", fmt::join(key, "_"));
}

SignalColumns find_signal(const ChannelTable& table, const std::vector<std::string>& listed,
                          LoggedQuantity quantity, LoggedOrigin worst) {
  if (!listed.empty()) return listed_signal(table, listed, quantity);
  for (const LoggedOrigin origin :
       {LoggedOrigin::kSensor, LoggedOrigin::kPlain, LoggedOrigin::kCommanded}) {
    if (origin > worst) break;
    SignalColumns found = named_signal(table, quantity, origin);
    if (!found.empty()) return found;
  }
  return {};
}

SignalColumns find_position_commands(const ChannelTable& table) {
  return named_signal(table, LoggedQuantity::kPosition, LoggedOrigin::kCommanded);
}

JointMatch match_joints(const std::vector<Key>& keys, const std::vector<WantedJoint>& wanted,
                        const LogMapping& mapping, const std::string& where) {
  std::vector<Key> logged;
  for (const Key& key : keys) logged.push_back(without_joint(key));
  const std::vector<Key> names = wanted_keys(wanted, mapping);
  if (const auto order = equal_keys(logged, names)) return {*order, false};
  const std::vector<Key> short_logged = without_common(logged);
  const std::vector<Key> short_names = without_common(names);
  if (const auto order = equal_keys(short_logged, short_names)) return {*order, false};
  if (const auto order = equal_keys(logged, short_names)) return {*order, false};
  if (const auto order = shifted_numbers(short_logged, short_names)) return {*order, false};
  const bool nameless = std::ranges::all_of(
      short_logged, [](const Key& key) { return key.empty() || number_of(key).has_value(); });
  if (nameless && keys.size() == wanted.size() && mapping.joints.empty()) {
    std::vector<std::size_t> order(keys.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    return {order, true};
  }
  std::vector<std::string> log_names;
  for (const Key& key : keys) log_names.push_back(key_text(key));
  std::vector<std::string> tree_names;
  for (const WantedJoint& joint : wanted) tree_names.push_back(joint.name);
  throw bad_input(
      where,
      fmt::format("the log's joints ({}) are not the tree's ({})", fmt::join(log_names, ", "),
                  fmt::join(tree_names, ", ")),
      fmt::format("say which is which in recording.yaml, dynamics: {{joints: {{{}: {}}}}}",
                  tree_names.front(), log_names.front()));
}

}  // namespace kinescope
