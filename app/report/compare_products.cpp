// SPDX-License-Identifier: Apache-2.0
//
// What a comparison says: words and compare.json.
#include <algorithm>

#include <fmt/format.h>

#include "app/report/compare_summary.h"
#include "app/report/facts.h"
#include "app/report/numbers.h"
#include "app/report/result_values.h"

namespace kinescope {
namespace {

using nlohmann::json;
using report::number;
using report::Quantity;
using report::text;

constexpr std::size_t kMostNamed = 4;  // in the verdict

Quantity shown_as(const RobotQuantity& of) {
  return of.unit.empty() ? Quantity::kPercent : report::quantity_of(of.unit);
}

// "zero of joint2 by 0.201 ± 0.012 °".
std::string change_words(const QuantityDifference& one) {
  const Quantity shown = shown_as(one.of);
  const std::string unit =
      shown == Quantity::kPlain ? one.of.unit : std::string(report::display_unit(shown).text);
  return fmt::format("{} by {} {}", one.of.name,
                     report::value_and_uncertainty(
                         one.difference, report::kCoverageFactor * one.sigma.value_or(0.0), shown),
                     unit);
}

std::vector<const QuantityDifference*> changed_of(const RunDifference& difference) {
  std::vector<const QuantityDifference*> out;
  for (const QuantityDifference& one : difference.quantities)
    if (one.changed) out.push_back(&one);
  return out;
}

std::size_t count_compared(const CompareSummary& summary) {
  std::size_t out = 0;
  for (const RunDifference& difference : summary.differences)
    out += static_cast<std::size_t>(std::ranges::count_if(
        difference.quantities, [](const auto& one) { return one.sigma.has_value(); }));
  return out;
}

std::string carried_words(const CompareSummary& summary, const CarriedOver& one) {
  const std::string& model = summary.runs[one.model].name;
  const std::string& recording = summary.runs[one.recording].name;
  if (!one.skipped.empty())
    return fmt::format("Model of {} on the recording of {}: not tried: {}.", model, recording,
                       one.skipped);
  const Quantity shown = report::quantity_of(one.unit);
  return fmt::format(
      "Model of {} on the recording of {}: {} on unseen postures, {} by its own "
      "model (p = {:.2g}): it {}.",
      model, recording, report::text_with_unit(one.carried_rms, shown),
      report::text_with_unit(one.own_rms, shown), one.p_value,
      one.carries ? "carries over" : "does not carry over");
}

json quantity_json(const QuantityDifference& one) {
  return {{"name", text(one.of.name)},
          {"joint", text(one.of.joint)},
          {"unit", text(one.of.unit)},
          {"first", number(one.first)},
          {"second", number(one.second)},
          {"difference", number(one.difference)},
          {"sigma", report::standard(one.sigma)},
          {"expanded", report::expanded(one.sigma)},
          {"p_value", one.sigma ? number(one.p_value) : json()},
          {"p_holm", one.sigma ? number(one.p_holm) : json()},
          {"changed", one.changed},
          {"not_compared", one.not_compared.empty() ? json() : text(one.not_compared)}};
}

json compared_run_json(const ComparedRun& run) {
  return {{"name", text(run.name)},
          {"robot", text(run.robot)},
          {"recording", run.recording.empty() ? json() : text(run.recording)},
          {"held_out_rms", number(run.held_out_rms)},
          {"rms_unit", text(run.rms_unit)},
          {"time_offset_s", number(run.time_offset_s)},
          {"time_offset_expanded_s", report::expanded(run.time_offset_sigma_s)}};
}

json carried_json(const CarriedOver& one) {
  const bool tried = one.skipped.empty();
  return {{"model", one.model},
          {"recording", one.recording},
          {"skipped", tried ? json() : text(one.skipped)},
          {"unit", tried ? text(one.unit) : json()},
          {"own_rms", tried ? number(one.own_rms) : json()},
          {"carried_rms", tried ? number(one.carried_rms) : json()},
          {"p_value", tried ? number(one.p_value) : json()},
          {"carries", tried ? json(one.carries) : json()}};
}

}  // namespace

bool anything_changed(const CompareSummary& summary) {
  return std::ranges::any_of(summary.differences, [](const RunDifference& one) {
    return !one.structure.empty() || !changed_of(one).empty();
  });
}

bool anything_fails_to_carry(const CompareSummary& summary) {
  return std::ranges::any_of(
      summary.carried, [](const CarriedOver& one) { return one.skipped.empty() && !one.carries; });
}

std::string compare_verdict(const CompareSummary& summary) {
  std::vector<std::string> named;
  std::size_t changed = 0;
  for (std::size_t k = 0; k < summary.differences.size(); ++k) {
    const RunDifference& difference = summary.differences[k];
    const std::string where = summary.runs.size() > 2 ? " in " + summary.runs[k + 1].name : "";
    for (const std::string& words : difference.structure)
      named.push_back("structure: " + words + where);
    const auto numbers = changed_of(difference);
    changed += numbers.size() + difference.structure.size();
    for (std::size_t i = 0; i < std::min(kMostNamed, numbers.size()); ++i)
      named.push_back(change_words(*numbers[i]) + where);
  }
  if (changed == 0) {
    const std::size_t compared = count_compared(summary);
    if (compared == 0) return "Nothing of the robot could be compared.";
    return fmt::format(
        "Same robot within noise: none of {} numbers differs (p >= {:g} after Holm).", compared,
        summary.level);
  }
  std::string out = "Changed";
  for (std::size_t i = 0; i < named.size(); ++i) out += (i == 0 ? ": " : "; ") + named[i];
  if (named.size() < changed) out += fmt::format("; and {} more", changed - named.size());
  return out + ".";
}

std::vector<std::string> compare_findings(const CompareSummary& summary) {
  std::vector<std::string> out;
  for (std::size_t k = 0; k < summary.differences.size(); ++k) {
    const RunDifference& difference = summary.differences[k];
    const std::string pair =
        fmt::format("{} against {}", summary.runs[k + 1].name, summary.runs.front().name);
    if (!difference.structure.empty()) {
      out.push_back(pair + ": another structure, so that its numbers are not compared.");
    } else {
      const auto changed = changed_of(difference);
      const auto compared = std::ranges::count_if(
          difference.quantities, [](const auto& one) { return one.sigma.has_value(); });
      out.push_back(fmt::format("{}: {} of {} numbers differ.", pair, changed.size(), compared));
      for (const QuantityDifference* one : changed)
        out.push_back(fmt::format("  {} (p = {:.2g} after Holm)", change_words(*one), one->p_holm));
    }
    for (const std::string& note : difference.notes) out.push_back("  " + note);
  }
  for (const CarriedOver& one : summary.carried) out.push_back(carried_words(summary, one));
  return out;
}

json compare_json(const CompareSummary& summary) {
  json runs = json::array(), differences = json::array(), carried = json::array();
  for (const ComparedRun& run : summary.runs) runs.push_back(compared_run_json(run));
  for (std::size_t k = 0; k < summary.differences.size(); ++k) {
    const RunDifference& one = summary.differences[k];
    json quantities = json::array();
    for (const QuantityDifference& quantity : one.quantities)
      quantities.push_back(quantity_json(quantity));
    differences.push_back({{"run", k + 1},
                           {"structure", report::texts(one.structure)},
                           {"matched_by", one.by_order ? "order" : "channel"},
                           {"quantities", std::move(quantities)},
                           {"notes", report::texts(one.notes)}});
  }
  for (const CarriedOver& one : summary.carried) carried.push_back(carried_json(one));
  return {{"schema", "kinescope.compare"},
          {"schema_version", 1},
          {"version", text(summary.version)},
          {"command", text(summary.command)},
          {"inputs", report::inputs_json(summary.inputs)},
          {"level", number(summary.level)},
          {"correction", "holm"},
          {"changed", anything_changed(summary)},
          {"verdict", text(compare_verdict(summary))},
          {"runs", std::move(runs)},
          {"differences", std::move(differences)},
          {"carried_over", std::move(carried)},
          {"findings", report::texts(compare_findings(summary))}};
}

}  // namespace kinescope
