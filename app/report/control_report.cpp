// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <fmt/format.h>

#include "app/report/control_summary.h"
#include "app/report/experiment_plots.h"
#include "app/report/html.h"
#include "app/report/page.h"
#include "app/report/reproduction.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

std::string axis_of(const ControlSummary& summary, std::size_t joint, std::string_view what) {
  return fmt::format("{} of {}, {}", what, summary.joints[joint],
                     summary.types[joint] == JointType::kPrismatic ? "m" : "rad");
}

/// A table of one key of every run: rows are controllers, columns joints.
std::string joint_table(const ControlSummary& summary, const nlohmann::json& document,
                        const std::string& id, const std::string& caption, const std::string& key) {
  Table table(id, caption, document);
  std::vector<std::string> head = {"Controller"};
  head.insert(head.end(), summary.joints.begin(), summary.joints.end());
  table.header(head);
  for (std::size_t r = 0; r < summary.runs.size(); ++r) {
    table.begin_row();
    table.text(summary.runs[r].name);
    for (std::size_t j = 0; j < summary.joints.size(); ++j) {
      table.number(fmt::format("/runs/{}/{}/{}", r, key, j), Quantity::kPlain);
    }
  }
  return table.str();
}

std::string error_figure(const ControlSummary& summary, std::size_t joint, bool loaded) {
  std::vector<Curve> curves;
  for (const ControlRun& run : summary.runs) {
    if ((run.payload != "none") != loaded) continue;
    Curve curve{.name = run.name, .points = {}, .lower = {}, .upper = {}};
    for (Eigen::Index i = 0; i < summary.t_s.size(); ++i) {
      curve.points.emplace_back(summary.t_s[i], run.errors(i, static_cast<Eigen::Index>(joint)));
    }
    curves.push_back(std::move(curve));
  }
  const std::string title = loaded ? "Tracking error with the load" : "Tracking error";
  return figure(
      curve_plot(title, {.label = "time, s"}, {.label = axis_of(summary, joint, "error")}, curves),
      fmt::format("{}: the worst joint of PD with nominal gravity", title), "half");
}

std::string rounds_figure(const ControlSummary& summary, std::size_t joint) {
  Curve curve{.name = "error", .points = {}, .lower = {}, .upper = {}};
  for (const ControlRun& run : summary.runs) {
    if (!run.round) continue;
    curve.points.emplace_back(*run.round, run.error[static_cast<Eigen::Index>(joint)]);
  }
  if (curve.points.empty()) return {};
  return figure(curve_plot("Error by round", {.label = "round"},
                           {.label = axis_of(summary, joint, "rms error"), .log10 = true}, {curve}),
                "The loop closed: run, log, learn, compensate, run again; round 0 knows nothing",
                "half");
}

std::string errors_section(const ControlSummary& summary, const nlohmann::json& document) {
  const std::size_t joint = worst_joint(summary.runs.front());
  std::string out = section_head("errors", "Tracking errors");
  out += "<div class=\"figures\">" + error_figure(summary, joint, false);
  if (summary.payload_kg) out += error_figure(summary, joint, true);
  out += rounds_figure(summary, joint) + "</div>\n";
  out += joint_table(summary, document, "errors-table",
                     "Root mean square tracking error, rad (m for joints that slide)", "error");
  out += joint_table(summary, document, "largest-table", "Largest tracking error, rad or m",
                     "largest_error");
  return out + "</section>\n";
}

std::string torque_section(const ControlSummary& summary, const nlohmann::json& document) {
  std::string out = section_head("torque", "Who does the work");
  out += joint_table(summary, document, "feedback-table",
                     "Share of the feedback: rms of its torque over that of the command",
                     "feedback_share");
  out += paragraph(
      "The learned part fades to the nominal masses where the model is in doubt: its weight is "
      "e^2 / (e^2 + s^2), with s the model's doubt and e what the nominal masses lack where it was "
      "learned.");
  out += joint_table(summary, document, "weight-table",
                     "Mean weight of what was learned; 0 where nothing was", "learned_weight");
  return out + "</section>\n";
}

std::string reproduce(const ControlSummary& summary) {
  Reproduction of{.command = summary.command, .inputs = summary.inputs};
  for (const ControlRun& run : summary.runs) of.products.emplace_back(run.log, run.name);
  return reproduction_section(of);
}

}  // namespace
}  // namespace kinescope::report

namespace kinescope {

std::string control_html(const ControlSummary& summary) {
  using namespace report;
  const nlohmann::json document = control_json(summary);
  const std::vector<ContentsEntry> contents = {{"verdict", "Findings"},
                                               {"errors", "Tracking errors"},
                                               {"torque", "Who does the work"},
                                               {"reproduce", "How to reproduce"}};
  std::string out = page_begin("control", "Control of " + summary.robot, summary.robot,
                               summary.version, contents);
  out += "<main>\n" + section_head("verdict", "Findings");
  for (const std::string& finding : control_findings(summary)) out += paragraph(finding);
  if (!summary.model.empty()) out += paragraph("Model: " + summary.model + ".");
  if (!summary.training.empty()) out += paragraph("Rounds learn on " + summary.training + ".");
  out += "</section>\n" + errors_section(summary, document) + torque_section(summary, document);
  return out + reproduce(summary) + "</main>\n</body>\n</html>\n";
}

}  // namespace kinescope
