// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/tool_table.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "kinematics/core/date_time.h"
#include "kinematics/core/error.h"
#include "kinematics/log/header_units.h"

namespace kinescope {
namespace {

constexpr std::array<std::string_view, 4> kTimes{"t", "time", "stamp", "timestamp"};
// Of `rostopic echo -p`: when the robot's driver wrote the message, and when it came.
constexpr std::array<std::string_view, 2> kRosTimes{"field.header.stamp", "%time"};
constexpr std::string_view kPlotJugglerTime = "__time";
constexpr std::string_view kTime = "t";

std::string lower(std::string_view text) {
  std::string out(text);
  std::ranges::transform(out, out.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

std::optional<std::size_t> usual_time(const CsvTable& table) {
  for (std::size_t c = 0; c < table.header.size(); ++c) {
    const std::string name = lower(without_unit(table.header[c]));
    if (std::ranges::find(kTimes, name) != kTimes.end()) return c;
  }
  return std::nullopt;
}

void remove_column(CsvTable& table, std::size_t column) {
  const auto at = static_cast<std::ptrdiff_t>(column);
  table.header.erase(table.header.begin() + at);
  for (std::vector<std::string>& row : table.rows) row.erase(row.begin() + at);
}

bool counts_rows(const CsvTable& table, std::size_t column) {
  std::optional<double> before;
  return std::ranges::all_of(table.rows, [&](const std::vector<std::string>& row) {
    const auto value = parse_number(row[column]);
    const bool next = value && *value == std::round(*value) && (!before || *value == *before + 1);
    before = value;
    return next;
  });
}

std::string said(const CsvTable& table, const std::string& what) {
  return fmt::format("{}: the time is {}", table.source, what);
}

// "header.stamp.sec" beside "header.stamp.nanosec", "secs" beside "nsecs": the column of the other.
std::optional<std::size_t> nanoseconds_beside(const CsvTable& table, std::size_t seconds) {
  static const std::map<std::string, std::vector<std::string>> kNanoseconds{
      {"sec", {"nanosec", "nsec"}}, {"secs", {"nsecs", "nanosecs"}}};
  const std::string& name = table.header[seconds];
  const std::size_t word = name.find_last_of("._/") + 1;  // 0 where there is none
  const auto beside = kNanoseconds.find(lower(std::string_view(name).substr(word)));
  if (beside == kNanoseconds.end()) return std::nullopt;
  for (const std::string& other : beside->second)
    for (std::size_t c = 0; c < table.header.size(); ++c)
      if (lower(table.header[c]) == lower(name.substr(0, word)) + other) return c;
  return std::nullopt;
}

// A number in s that was written in ns, without losing digits.
std::string from_nanoseconds(const std::string& seconds, const std::string& nanoseconds) {
  const auto s = parse_number(seconds);
  const auto ns = parse_number(nanoseconds);
  if (!s || !ns) return "";
  return fmt::format("{:.9f}", *s + 1e-9 * *ns);
}

bool take_split_time(CsvTable& table, std::vector<std::string>& lines) {
  for (std::size_t c = 0; c < table.header.size(); ++c) {
    const auto nanoseconds = nanoseconds_beside(table, c);
    if (!nanoseconds) continue;
    lines.push_back(said(
        table, fmt::format("'{}' with '{}' (ns)", table.header[c], table.header[*nanoseconds])));
    for (std::vector<std::string>& row : table.rows)
      row[c] = from_nanoseconds(row[c], row[*nanoseconds]);
    table.header[c] = kTime;
    remove_column(table, *nanoseconds);
    return true;
  }
  return false;
}

bool take_ros_time(CsvTable& table, std::vector<std::string>& lines) {
  for (const std::string_view name : kRosTimes) {
    const auto column = table.column(name);
    if (!column) continue;
    const bool stamped = std::ranges::any_of(table.rows, [&](const auto& row) {
      return parse_number(row[*column]).value_or(0.0) != 0.0;
    });
    if (!stamped) continue;
    lines.push_back(said(table, fmt::format("'{}' (ns)", name)));
    for (std::vector<std::string>& row : table.rows)
      row[*column] = from_nanoseconds("0", row[*column]);
    table.header[*column] = kTime;
    return true;
  }
  return false;
}

bool take_named_time(CsvTable& table, std::string_view name, const std::string& words,
                     std::vector<std::string>& lines) {
  const auto column = table.column(name);
  if (!column) return false;
  lines.push_back(said(table, words));
  table.header[*column] = kTime;
  return true;
}

bool is_increasing(const CsvTable& table, std::size_t column) {
  std::optional<double> before;
  return std::ranges::all_of(table.rows, [&](const std::vector<std::string>& row) {
    const auto date = parse_date_time(row[column]);
    const auto value = date ? date : parse_number(row[column]);
    const bool later = value && (!before || *value > *before);
    before = value;
    return later;
  });
}

// The index that pandas writes in front: numbers of rows, or the time.
void place_unnamed(CsvTable& table, std::vector<std::string>& lines) {
  const auto column = table.column(kUnnamedColumn);
  if (!column) return;
  if (counts_rows(table, *column)) {
    remove_column(table, *column);
    return;
  }
  if (usual_time(table) || !is_increasing(table, *column)) {
    throw bad_input(fmt::format("{}:{}", table.source, table.header_line),
                    fmt::format("column {} has no name", *column + 1), "name every column");
  }
  static_cast<void>(
      take_named_time(table, kUnnamedColumn, "the first column, which has no name (s)", lines));
}

// The last part of a path in front of "/position" and such.
struct JointColumn {
  std::string joint;
  std::string quantity;  ///< "position", "velocity", "effort"
};

std::optional<JointColumn> path_of_joint(const std::string& name) {
  const std::size_t slash = name.rfind('/');
  if (slash == std::string::npos || slash == 0) return std::nullopt;
  const std::string quantity = name.substr(slash + 1);
  if (quantity != "position" && quantity != "velocity" && quantity != "effort") return std::nullopt;
  const std::string path = name.substr(0, slash);
  const std::string joint = path.substr(path.rfind('/') + 1);  // all of it where there is none
  if (joint.empty()) return std::nullopt;
  return JointColumn{joint, quantity};
}

// "field.position3" of `rostopic echo -p`, by what "field.name3" says.
std::optional<JointColumn> field_of_joint(const CsvTable& table, const std::string& name) {
  for (const char* quantity : {"position", "velocity", "effort"}) {
    const std::string prefix = std::string("field.") + quantity;
    if (!name.starts_with(prefix) || name.size() == prefix.size()) continue;
    const std::string number = name.substr(prefix.size());
    const auto names = table.column("field.name" + number);
    const bool named = names && !table.rows.empty() && !table.rows.front()[*names].empty();
    return JointColumn{named ? table.rows.front()[*names] : "joint" + number, quantity};
  }
  return std::nullopt;
}

std::optional<JointColumn> joint_of(const CsvTable& table, const std::string& name) {
  const auto path = path_of_joint(name);
  return path ? path : field_of_joint(table, name);
}

std::string log_name(const CsvTable& table, const std::string& name) {
  const auto joint = joint_of(table, name);
  if (!joint) return name;
  if (joint->quantity == "position") return joint->joint;
  return joint->quantity == "effort" ? "tau_" + joint->joint : "";
}

// Counters and names of a message, which are no joints.
bool is_of_header(const std::string& name) {
  return name == "%time" || name.starts_with("field.header.") || name.starts_with("field.name") ||
         name == "header.seq" || name == "header.frame_id";
}

// "actual_q_0" of Universal Robots' real-time data exchange: a joint's measured position.
bool is_rtde_position(std::string_view name) {
  constexpr std::string_view kPosition = "actual_q_";
  return name.size() > kPosition.size() && name.starts_with(kPosition) &&
         std::ranges::all_of(name.substr(kPosition.size()),
                             [](unsigned char c) { return std::isdigit(c) != 0; });
}

// Its other fields (RTDE guide, "Data fields"): velocities, currents, targets, poses of the tool,
// states of the controller.
bool is_other_rtde_field(std::string_view name) {
  constexpr std::array<std::string_view, 14> kFields{"actual_",
                                                     "target_",
                                                     "joint_control_output",
                                                     "joint_temperatures",
                                                     "joint_mode",
                                                     "robot_mode",
                                                     "robot_status",
                                                     "safety_",
                                                     "runtime_state",
                                                     "speed_scaling",
                                                     "tool_",
                                                     "tcp_force",
                                                     "ft_raw_wrench",
                                                     "payload"};
  return !is_rtde_position(name) && std::ranges::any_of(kFields, [&](std::string_view field) {
    return name.starts_with(field);
  });
}

}  // namespace

bool dates_to_seconds(CsvTable& table, std::size_t column) {
  bool any = false;
  for (std::vector<std::string>& row : table.rows) {
    const auto seconds = parse_date_time(row[column]);
    if (!seconds) continue;
    row[column] = fmt::format("{:.9f}", *seconds);
    any = true;
  }
  return any;
}

std::vector<std::string> make_time_plain(CsvTable& table) {
  std::vector<std::string> lines;
  place_unnamed(table, lines);
  const bool found =
      usual_time(table) || take_split_time(table, lines) || take_ros_time(table, lines) ||
      take_named_time(table, kPlotJugglerTime, fmt::format("'{}' (s)", kPlotJugglerTime), lines);
  const auto time = found ? usual_time(table) : std::nullopt;
  if (time && dates_to_seconds(table, *time))
    lines.push_back(said(table, "written as dates: s since 1970, in UTC where no zone is given"));
  return lines;
}

std::vector<std::string> log_names(const CsvTable& table) {
  const bool has_positions = std::ranges::any_of(table.header, [&](const std::string& name) {
    const auto joint = joint_of(table, name);
    return joint && joint->quantity == "position";
  });
  const bool of_rtde = std::ranges::any_of(table.header, is_rtde_position);
  std::vector<std::string> out = table.header;
  std::map<std::string, int> uses;
  for (std::string& name : out) {
    if (is_of_header(name) || (of_rtde && is_other_rtde_field(name))) {
      name.clear();
    } else if (has_positions) {
      name = log_name(table, name);
    }
    ++uses[name];
  }
  // Of two robots with joints of one name the whole path is the name.
  for (std::size_t c = 0; c < out.size(); ++c)
    if (!out[c].empty() && uses[out[c]] > 1) out[c] = table.header[c];
  return out;
}

CsvTable with_log_names(CsvTable table, const std::vector<std::string>& keep) {
  const std::vector<std::string> names = log_names(table);
  for (std::size_t c = names.size(); c-- > 0;) {
    if (names[c].empty() && std::ranges::find(keep, table.header[c]) != keep.end()) continue;
    table.header[c] = names[c];
    if (names[c].empty()) remove_column(table, c);
  }
  return table;
}

}  // namespace kinescope
