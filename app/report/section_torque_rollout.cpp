// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <utility>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/sections.h"
#include "app/report/torque_sections.h"

namespace kinescope::report {
namespace {

constexpr std::array<std::pair<const char*, const char*>, 3> kModels = {
    {{"with_effects", "with what tracing found"},
     {"without_effects", "without"},
     {"held", "the motion itself"}}};

std::string rollout_table(const TorqueFacts& facts) {
  Table table(
      "rollout-table",
      "Distance from the measured motion, medians over the windows (joints in degrees or mm)",
      facts.result);
  const Rollout& rollout = facts.summary.rollout->found;
  std::vector<std::string> head{"After, s", "Windows", "Model"};
  head.insert(head.end(), facts.summary.joints.begin(), facts.summary.joints.end());
  if (!rollout.tip.empty()) head.push_back(rollout.tip + ", mm");
  table.header(head);
  for (std::size_t h = 0; h < rollout.horizons.size(); ++h) {
    for (const auto& [key, words] : kModels) {
      const std::string at = fmt::format("/rollout/horizons/{}/", h);
      table.begin_row();
      table.number(at + "horizon_s", Quantity::kTime);
      table.number(at + "windows", Quantity::kCount);
      table.text(words);
      for (std::size_t j = 0; j < facts.summary.joints.size(); ++j) {
        table.number(
            fmt::format("{}{}/joints/{}", at, key, j),
            facts.summary.types[j] == JointType::kPrismatic ? Quantity::kLength : Quantity::kAngle);
      }
      if (!rollout.tip.empty()) {
        table.number(fmt::format("{}{}/tool_m", at, key), Quantity::kLength);
      }
    }
  }
  return table.str();
}

}  // namespace

std::string torque_rollout_section(const TorqueFacts& facts) {
  if (!facts.summary.rollout) return "";
  const Rollout& rollout = facts.summary.rollout->found;
  std::string out = section_head("rollout", "Forward in time");
  out += paragraph(torque_verdict(facts.summary).rollout);
  if (!rollout.horizons.empty()) out += rollout_table(facts);
  out += paragraph(
      "Open loop from measured states: nothing pulls the model back, so errors of the torque grow "
      "with the square of the time.",
      "note");
  return out + "</section>\n";
}

}  // namespace kinescope::report
