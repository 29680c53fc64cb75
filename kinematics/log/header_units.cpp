// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/header_units.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

namespace kinescope {
namespace {

/// Units by their factor to SI; those of derivatives and torques are cut off and not converted.
std::optional<double> factor_of(std::string_view unit) {
  static const std::map<std::string, double, std::less<>> kFactors = {
      {"s", 1.0},      {"sec", 1.0},      {"seconds", 1.0}, {"ms", 1e-3},
      {"us", 1e-6},    {"\u00b5s", 1e-6}, {"ns", 1e-9},     {"m", 1.0},
      {"cm", 1e-2},    {"mm", 1e-3},      {"rad", 1.0},     {"deg", std::numbers::pi / 180.0},
      {"px", 1.0},     {"pixel", 1.0},    {"pixels", 1.0},  {"ticks", 1.0},
      {"counts", 1.0}, {"rad/s", 1.0},    {"deg/s", 1.0},   {"m/s", 1.0},
      {"mm/s", 1.0},   {"Nm", 1.0},       {"N", 1.0},       {"mNm", 1.0},
      {"A", 1.0},      {"mA", 1.0}};
  const auto found = kFactors.find(unit);
  if (found == kFactors.end()) return std::nullopt;
  return found->second;
}

/// Of a time: "t_ms", "time_s", "timestamp_ns".
std::pair<std::string_view, std::string_view> time_and_unit(std::string_view column) {
  constexpr std::array<std::string_view, 4> kTimes{"t", "time", "stamp", "timestamp"};
  constexpr std::array<std::string_view, 6> kUnits{"s", "sec", "seconds", "ms", "us", "ns"};
  const std::size_t line = column.rfind('_');
  if (line == std::string_view::npos) return {column, {}};
  const std::string_view name = column.substr(0, line);
  const std::string_view unit = column.substr(line + 1);
  const bool time = std::ranges::any_of(kTimes, [&](std::string_view known) {
    return std::ranges::equal(name, known, [](unsigned char a, unsigned char b) {
      return std::tolower(a) == static_cast<int>(b);
    });
  });
  if (!time || std::ranges::find(kUnits, unit) == kUnits.end()) return {column, {}};
  return {name, unit};
}

/// Name and unit; no unit where the name ends in none.
std::pair<std::string_view, std::string_view> name_and_unit(std::string_view column) {
  if (!column.ends_with(']') && !column.ends_with(')')) return time_and_unit(column);
  const std::size_t open = column.rfind(column.ends_with(']') ? '[' : '(');
  if (open == std::string_view::npos) return {column, {}};
  const std::string_view unit = column.substr(open + 1, column.size() - open - 2);
  const std::size_t end = column.substr(0, open).find_last_not_of(' ');
  if (end == std::string_view::npos || !factor_of(unit)) return {column, {}};
  return {column.substr(0, end + 1), unit};
}

}  // namespace

std::string without_unit(std::string_view column) {
  return std::string(name_and_unit(column).first);
}

double header_factor(std::string_view column) {
  return factor_of(name_and_unit(column).second).value_or(1.0);
}

void strip_units(CsvTable& table) {
  std::map<std::string, int> uses;
  for (const std::string& column : table.header) ++uses[without_unit(column)];
  for (std::string& column : table.header) {
    const std::string name = without_unit(column);
    if (uses[name] == 1) column = name;
  }
}

}  // namespace kinescope
