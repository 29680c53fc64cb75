// SPDX-License-Identifier: Apache-2.0
//
// Takes   what the runs of many robots came to, each with recordings of its own.
// Gives   one table of all robots, worst first: in words, as fleet.json (schema:
//         app/io/schema/fleet.schema.json), as fleet.csv, as a page.
// Units   SI.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"

namespace kinescope {

/// What the robot has and its plain model lacks.
struct FleetEffect {
  std::string effect, place;
  std::optional<double> size;
  std::string unit;        ///< of size; empty: a ratio
  double explained = 0.0;  ///< share of the plain model's squares that it alone takes away
};

struct FleetRobot {
  std::string name;
  std::vector<std::string> recordings;   ///< as the list has them
  int exit_code = 0;                     ///< of its run
  std::string reason;                    ///< of another code than 0
  std::optional<double> held_out_rms;    ///< on postures that the fit has not seen
  std::string unit;                      ///< of it: px or m
  std::optional<double> tip_expanded_m;  ///< of the last link, k = 2
  std::optional<double> tip_expanded_rad;
  std::vector<FleetEffect> effects;  ///< the one that explains most first
  int warnings = 0;
};

struct FleetSummary {
  std::string version, command;
  std::vector<InputFile> inputs;  ///< the list of robots
  std::vector<FleetRobot> robots;
};

/// Its run ended with a robot, within limits or not.
[[nodiscard]] bool has_answer(const FleetRobot& robot);

/// A row from what `run --json` prints; null, of a run that came to no result, leaves the numbers
/// open.
void take_result(const nlohmann::json& result, FleetRobot& robot);

/// Those without an answer, then those outside limits, then by their held-out error (px before m)
/// and by what is known of the last link.
[[nodiscard]] std::vector<FleetRobot> worst_first(std::vector<FleetRobot> robots);

/// One line over all.
[[nodiscard]] std::string fleet_verdict(const FleetSummary& summary);
/// A line a robot.
[[nodiscard]] std::vector<std::string> fleet_lines(const FleetSummary& summary);
/// A row as it stands in fleet.json, and back. The latter throws json::exception.
[[nodiscard]] nlohmann::json fleet_robot_json(const FleetRobot& robot);
[[nodiscard]] FleetRobot fleet_robot_of(const nlohmann::json& row);
[[nodiscard]] nlohmann::json fleet_json(const FleetSummary& summary);
[[nodiscard]] std::string fleet_csv(const FleetSummary& summary);
[[nodiscard]] std::string fleet_html(const FleetSummary& summary);

}  // namespace kinescope
