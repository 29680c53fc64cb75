// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/report/fleet_summary.h"
#include "app/report/html.h"
#include "app/report/page.h"
#include "app/report/reproduction.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

// Beside the page, where the run came to an answer.
std::string name_of(const FleetRobot& robot) {
  if (!has_answer(robot)) return escaped(robot.name);
  return fmt::format("<a href=\"{0}/report.html\">{0}</a>", escaped(robot.name));
}

std::string effects_of(const nlohmann::json& row) {
  std::vector<std::string> words;
  for (const nlohmann::json& effect : row.at("effects"))
    words.push_back(effect.at("words").get<std::string>());
  return words.empty() ? "none" : fmt::format("{}: {}", words.size(), fmt::join(words, ", "));
}

std::string robots_section(const FleetSummary& summary, const nlohmann::json& document) {
  Table table("robots-table",
              "Without an answer first, then outside limits, then by the error on unseen postures; "
              "uncertainties of the last link are expanded (k = 2)",
              document);
  table.header({"Robot", "Exit code", "Held-out error", "Last link, position",
                "Last link, orientation", "Effects", "Why"});
  for (std::size_t k = 0; k < summary.robots.size(); ++k) {
    const FleetRobot& robot = summary.robots[k];
    const std::string at = fmt::format("/robots/{}/", k);
    table.begin_row();
    table.html(name_of(robot));
    table.number(at + "exit_code", Quantity::kCount);
    table.number_with_unit(at + "held_out_rms", quantity_of(robot.unit));
    table.uncertainty_with_unit(at + "tip_expanded_m", Quantity::kLength);
    table.uncertainty_with_unit(at + "tip_expanded_rad", Quantity::kAngle);
    table.text(effects_of(document.at("robots").at(k)));
    table.text(robot.reason);
  }
  return section_head("robots", "The robots, worst first") + table.str() + "</section>\n";
}

}  // namespace
}  // namespace kinescope::report

namespace kinescope {

std::string fleet_html(const FleetSummary& summary) {
  using namespace report;
  const nlohmann::json document = fleet_json(summary);
  const std::vector<ContentsEntry> contents = {{"verdict", "Verdict"},
                                               {"robots", "The robots, worst first"},
                                               {"reproduce", "How to reproduce"}};
  return page_begin("fleet", "Fleet", fmt::format("{} robots", summary.robots.size()),
                    summary.version, contents) +
         "<main>\n" + section_head("verdict", "Verdict") + paragraph(fleet_verdict(summary)) +
         "</section>\n" + robots_section(summary, document) +
         reproduction_section(
             {.command = summary.command,
              .inputs = summary.inputs,
              .products = {{"fleet.json", "all numbers"}, {"fleet.csv", "the table"}}}) +
         "</main>\n</body>\n</html>\n";
}

}  // namespace kinescope
