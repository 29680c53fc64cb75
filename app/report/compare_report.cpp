// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "app/report/compare_summary.h"
#include "app/report/facts.h"
#include "app/report/html.h"
#include "app/report/page.h"
#include "app/report/plot.h"
#include "app/report/reproduction.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

constexpr std::size_t kMostPlots = 6;

Quantity quantity_shown(const RobotQuantity& of) {
  return of.unit.empty() ? Quantity::kPercent : quantity_of(of.unit);
}

// Of the number in a run; nothing where it was not compared there.
const QuantityDifference* compared_in(const RunDifference& run, const std::string& name) {
  const auto found = std::ranges::find_if(
      run.quantities, [&](const auto& one) { return one.of.name == name && one.sigma; });
  return found == run.quantities.end() ? nullptr : &*found;
}

// Names of the numbers that differ most clearly in any run, worst first.
std::vector<RobotQuantity> worst_quantities(const CompareSummary& summary) {
  std::vector<const QuantityDifference*> all;
  for (const RunDifference& run : summary.differences)
    for (const QuantityDifference& one : run.quantities)
      if (one.sigma) all.push_back(&one);
  std::ranges::stable_sort(all, {}, &QuantityDifference::p_value);
  std::vector<RobotQuantity> out;
  for (const QuantityDifference* one : all) {
    const bool known =
        std::ranges::any_of(out, [&](const RobotQuantity& of) { return of.name == one->of.name; });
    if (!known && out.size() < kMostPlots) out.push_back(one->of);
  }
  return out;
}

// Over the runs in the order given: the difference from the first, with its interval.
std::string plot_over_runs(const CompareSummary& summary, const RobotQuantity& of) {
  const DisplayUnit unit = display_unit(quantity_shown(of));
  double low = 0.0, high = 0.0;
  std::vector<Eigen::Vector2d> points{{1.0, 0.0}};
  std::vector<double> half{0.0};
  for (std::size_t k = 0; k < summary.differences.size(); ++k) {
    const QuantityDifference* one = compared_in(summary.differences[k], of.name);
    if (one == nullptr) continue;
    points.emplace_back(static_cast<double>(k) + 2.0, unit.factor * one->difference);
    half.push_back(unit.factor * kCoverageFactor * one->sigma.value_or(0.0));
    low = std::min(low, points.back().y() - half.back());
    high = std::max(high, points.back().y() + half.back());
  }
  pad_range(low, high, 0.1);
  const auto runs = static_cast<double>(summary.runs.size());
  Plot plot(of.name, {.label = "run, as given", .lower = 0.5, .upper = runs + 0.5},
            {.label = fmt::format("change, {}", unit.text.empty() ? of.unit : unit.text),
             .lower = low,
             .upper = high});
  plot.line({{0.5, 0.0}, {runs + 0.5, 0.0}}, "c7");
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Eigen::Vector2d up(0.0, half[i]);
    plot.line({points[i] - up, points[i] + up}, series_class(0));
  }
  plot.dots(points, series_class(0));
  return figure(plot.str(),
                of.name +
                    ": difference from the first run, with its expanded "
                    "uncertainty (k = 2)",
                "half");
}

std::string differences_section(const CompareSummary& summary, const nlohmann::json& document) {
  std::string out = section_head("differences", "What differs of the robot");
  for (std::size_t k = 0; k < summary.differences.size(); ++k) {
    const RunDifference& run = summary.differences[k];
    const std::string title =
        fmt::format("{} against {}", summary.runs[k + 1].name, summary.runs.front().name);
    for (const std::string& words : run.structure)
      out += paragraph(fmt::format("{}: {}.", title, words));
    for (const std::string& note : run.notes) out += paragraph(fmt::format("{}: {}", title, note));
    if (run.quantities.empty()) continue;
    Table table(fmt::format("differences-{}", k + 1), title + ", worst first", document);
    table.header({"Number", "Change", "Expanded uncertainty", "p", "p after Holm", "Verdict"});
    for (std::size_t i = 0; i < run.quantities.size(); ++i) {
      const QuantityDifference& one = run.quantities[i];
      const std::string at = fmt::format("/differences/{}/quantities/{}/", k, i);
      const Quantity shown = quantity_shown(one.of);
      table.begin_row();
      table.text(one.of.name);
      table.number_with_unit(at + "difference", shown);
      table.uncertainty_with_unit(at + "expanded", shown, "not compared");
      table.number(at + "p_value", Quantity::kPlain);
      table.number(at + "p_holm", Quantity::kPlain);
      table.text(one.sigma ? (one.changed ? "changed" : "within noise") : one.not_compared);
    }
    out += table.str();
  }
  out += "<div class=\"figures\">";
  for (const RobotQuantity& of : worst_quantities(summary)) out += plot_over_runs(summary, of);
  return out + "</div>\n</section>\n";
}

std::string runs_section(const CompareSummary& summary, const nlohmann::json& document) {
  std::string out = section_head("runs", "The calibrations");
  Table table("runs-table",
              "In the order given; their clocks are the recordings' own and no part "
              "of the robot",
              document);
  table.header({"Run", "Recording", "Held-out error", "Log time minus frame time"});
  for (std::size_t k = 0; k < summary.runs.size(); ++k) {
    const std::string at = fmt::format("/runs/{}/", k);
    table.begin_row();
    table.text(summary.runs[k].name);
    table.text(summary.runs[k].recording);
    table.number_with_unit(at + "held_out_rms", quantity_of(summary.runs[k].rms_unit));
    table.number_with_unit(at + "time_offset_s", Quantity::kDelay);
  }
  return out + table.str() + "</section>\n";
}

std::string carried_section(const CompareSummary& summary, const nlohmann::json& document) {
  std::string out = section_head("carried", "One's model on another's recording");
  out += paragraph(
      "Camera, markers and clock are fitted anew, the robot is held; both errors are of postures "
      "that the fit has not seen.");
  Table table("carried-table", "Prediction of recordings by other runs' models", document);
  table.header({"Model", "Recording", "Its own model", "This model", "p", "Verdict"});
  for (std::size_t i = 0; i < summary.carried.size(); ++i) {
    const CarriedOver& one = summary.carried[i];
    const std::string at = fmt::format("/carried_over/{}/", i);
    const Quantity shown = quantity_of(one.unit);
    table.begin_row();
    table.text(summary.runs[one.model].name);
    table.text(summary.runs[one.recording].name);
    table.number_with_unit(at + "own_rms", shown);
    table.number_with_unit(at + "carried_rms", shown);
    table.number(at + "p_value", Quantity::kPlain);
    table.text(!one.skipped.empty() ? one.skipped
                                    : (one.carries ? "carries over" : "does not carry over"));
  }
  return out + table.str() + "</section>\n";
}

}  // namespace
}  // namespace kinescope::report

namespace kinescope {

std::string compare_html(const CompareSummary& summary) {
  using namespace report;
  const nlohmann::json document = compare_json(summary);
  const std::vector<ContentsEntry> contents = {{"verdict", "Verdict"},
                                               {"differences", "What differs of the robot"},
                                               {"carried", "One's model on another's recording"},
                                               {"runs", "The calibrations"},
                                               {"reproduce", "How to reproduce"}};
  std::string out =
      page_begin("comparison", "Runs of " + summary.runs.front().robot,
                 fmt::format("{} runs", summary.runs.size()), summary.version, contents);
  out += "<main>\n" + section_head("verdict", "Verdict") + paragraph(compare_verdict(summary));
  for (const std::string& finding : compare_findings(summary)) out += paragraph(finding);
  out += paragraph(fmt::format(
      "Base frame, camera, markers and clocks are the recordings' own and take no part; so do the "
      "zeros of the first joint and of the last, which they hide. p-values are corrected together "
      "(Holm): where nothing changed, anything is called changed in {:g} % of comparisons at most.",
      100.0 * summary.level));
  out += "</section>\n" + differences_section(summary, document) +
         carried_section(summary, document) + runs_section(summary, document);
  return out +
         reproduction_section({.command = summary.command,
                               .inputs = summary.inputs,
                               .products = {{"compare.json", "all numbers"}}}) +
         "</main>\n</body>\n</html>\n";
}

}  // namespace kinescope
