// SPDX-License-Identifier: Apache-2.0
//
// What the table of a fleet says: words, fleet.json and fleet.csv.
#include <algorithm>
#include <limits>
#include <tuple>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/report/fleet_summary.h"
#include "app/report/html.h"
#include "app/report/numbers.h"
#include "app/report/quoted_cell.h"
#include "app/report/result_values.h"

namespace kinescope {
namespace {

using nlohmann::json;
using report::number_at;
using report::Quantity;
using report::quoted_cell;
using report::text;

constexpr int kOutsideLimits = 5;  // an answer all the same

json optional_number(const std::optional<double>& value) {
  return value ? report::number(*value) : json();
}

std::optional<double> number_of(const json& value) {
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}

// Smaller: worse.
auto rank_of(const FleetRobot& robot) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const int group = has_answer(robot) ? (robot.exit_code == 0 ? 2 : 1) : 0;
  return std::tuple(group, robot.unit != "px", -robot.held_out_rms.value_or(kNone),
                    -robot.tip_expanded_m.value_or(kNone));
}

std::string effect_words(const FleetEffect& effect) {
  std::string name = fmt::format("{} at {}", effect.effect, effect.place);
  if (!effect.size) return name;
  const Quantity shown = effect.unit.empty() ? Quantity::kPlain : report::quantity_of(effect.unit);
  const std::string unit = shown == Quantity::kPlain ? " " + effect.unit : std::string();
  return fmt::format("{} ({}{})", name, report::text_with_unit(*effect.size, shown),
                     effect.unit.empty() ? "" : unit);
}

std::string robot_words(const FleetRobot& robot) {
  if (!has_answer(robot))
    return fmt::format("{}: exit code {}: {}", robot.name, robot.exit_code, robot.reason);
  std::vector<std::string> words;
  if (robot.held_out_rms)
    words.push_back(report::text_with_unit(*robot.held_out_rms, report::quantity_of(robot.unit)) +
                    " held out");
  if (robot.tip_expanded_m)
    words.push_back("last link to " +
                    report::text_with_unit(*robot.tip_expanded_m, Quantity::kLength));
  for (const FleetEffect& effect : robot.effects) words.push_back(effect_words(effect));
  if (robot.exit_code != 0) words.push_back(robot.reason);
  return fmt::format("{}: {}", robot.name, fmt::join(words, ", "));
}

std::string number_cell(const std::optional<double>& value) {
  return value ? fmt::format("{}", *value) : std::string();
}

std::vector<FleetEffect> effects_of(const json& result) {
  std::vector<FleetEffect> out;
  const json::json_pointer place("/trace/accepted");
  if (!result.contains(place)) return out;
  for (const json& effect : result.at(place)) {
    out.push_back({effect.at("effect").get<std::string>(), effect.at("place").get<std::string>(),
                   number_of(effect.at("size")), effect.at("unit").get<std::string>(),
                   number_of(effect.at("explained")).value_or(0.0)});
  }
  std::ranges::stable_sort(out, std::greater{}, &FleetEffect::explained);
  return out;
}

}  // namespace

bool has_answer(const FleetRobot& robot) {
  return robot.exit_code == 0 || robot.exit_code == kOutsideLimits;
}

void take_result(const json& result, FleetRobot& robot) {
  if (!result.is_object()) return;
  const std::string kind = result.value(json::json_pointer("/run/kind"), std::string());
  robot.unit = kind == "corners" ? "px" : "m";
  robot.held_out_rms = number_at(result, fmt::format("/errors/all/held_out_{}/rms", robot.unit));
  robot.tip_expanded_m = number_at(result, "/tip/translation_expanded_m");
  robot.tip_expanded_rad = number_at(result, "/tip/rotation_expanded_rad");
  robot.effects = effects_of(result);
}

std::vector<FleetRobot> worst_first(std::vector<FleetRobot> robots) {
  std::ranges::sort(robots, {}, &FleetRobot::name);
  std::ranges::stable_sort(robots, {}, rank_of);
  return robots;
}

std::string fleet_verdict(const FleetSummary& summary) {
  const auto& robots = summary.robots;
  const auto failed =
      std::ranges::count_if(robots, [](const auto& one) { return !has_answer(one); });
  const auto outside = std::ranges::count(robots, kOutsideLimits, &FleetRobot::exit_code);
  std::string out = fmt::format("{} robot{}", robots.size(), robots.size() == 1 ? "" : "s");
  if (failed == 0 && outside == 0) return out + ", all with an answer.";
  if (failed > 0) out += fmt::format(", {} without an answer", failed);
  if (outside > 0) out += fmt::format(", {} outside limits", outside);
  return out + fmt::format("; worst: {}.", robots.front().name);
}

std::vector<std::string> fleet_lines(const FleetSummary& summary) {
  std::vector<std::string> out;
  for (const FleetRobot& robot : summary.robots) out.push_back(robot_words(robot));
  return out;
}

json fleet_robot_json(const FleetRobot& robot) {
  json effects = json::array();
  for (const FleetEffect& effect : robot.effects) {
    effects.push_back({{"effect", text(effect.effect)},
                       {"place", text(effect.place)},
                       {"size", optional_number(effect.size)},
                       {"unit", text(effect.unit)},
                       {"explained", report::number(effect.explained)},
                       {"words", text(effect_words(effect))}});
  }
  return {{"name", text(robot.name)},
          {"recordings", report::texts(robot.recordings)},
          {"exit_code", robot.exit_code},
          {"reason", robot.exit_code == 0 ? json() : text(robot.reason)},
          {"held_out_rms", optional_number(robot.held_out_rms)},
          {"rms_unit", robot.unit.empty() ? json() : text(robot.unit)},
          {"tip_expanded_m", optional_number(robot.tip_expanded_m)},
          {"tip_expanded_rad", optional_number(robot.tip_expanded_rad)},
          {"effects", std::move(effects)},
          {"warnings", robot.warnings}};
}

FleetRobot fleet_robot_of(const json& row) {
  const auto text_of = [&](const char* key) {
    return row.at(key).is_string() ? row.at(key).get<std::string>() : std::string();
  };
  FleetRobot out;
  out.name = text_of("name");
  out.recordings = row.at("recordings").get<std::vector<std::string>>();
  out.exit_code = row.at("exit_code").get<int>();
  out.reason = text_of("reason");
  out.held_out_rms = number_of(row.at("held_out_rms"));
  out.unit = text_of("rms_unit");
  out.tip_expanded_m = number_of(row.at("tip_expanded_m"));
  out.tip_expanded_rad = number_of(row.at("tip_expanded_rad"));
  for (const json& effect : row.at("effects")) {
    out.effects.push_back({effect.at("effect").get<std::string>(),
                           effect.at("place").get<std::string>(), number_of(effect.at("size")),
                           effect.at("unit").get<std::string>(),
                           number_of(effect.at("explained")).value_or(0.0)});
  }
  out.warnings = row.at("warnings").get<int>();
  return out;
}

json fleet_json(const FleetSummary& summary) {
  json robots = json::array();
  for (const FleetRobot& robot : summary.robots) robots.push_back(fleet_robot_json(robot));
  return {{"schema", "kinescope.fleet"},
          {"schema_version", 1},
          {"version", text(summary.version)},
          {"command", text(summary.command)},
          {"inputs", report::inputs_json(summary.inputs)},
          {"verdict", text(fleet_verdict(summary))},
          {"robots", std::move(robots)}};
}

std::string fleet_csv(const FleetSummary& summary) {
  std::string out =
      "robot,exit_code,reason,held_out_rms,rms_unit,tip_expanded_m,tip_expanded_rad,effects,"
      "largest_effect,largest_size,largest_unit,warnings\n";
  for (const FleetRobot& robot : summary.robots) {
    const FleetEffect none;
    const FleetEffect& largest = robot.effects.empty() ? none : robot.effects.front();
    out += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\n", quoted_cell(robot.name),
                       robot.exit_code, quoted_cell(robot.reason), number_cell(robot.held_out_rms),
                       robot.unit, number_cell(robot.tip_expanded_m),
                       number_cell(robot.tip_expanded_rad), robot.effects.size(),
                       robot.effects.empty()
                           ? ""
                           : quoted_cell(fmt::format("{} at {}", largest.effect, largest.place)),
                       number_cell(largest.size), quoted_cell(largest.unit), robot.warnings);
  }
  return out;
}

}  // namespace kinescope
