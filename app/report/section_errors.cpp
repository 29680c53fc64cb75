// SPDX-License-Identifier: Apache-2.0
//
// Errors before and after, training and held out apart.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/plot.h"
#include "app/report/recordings_json.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

struct Measure {
  std::string_view key;  ///< suffix of the document's keys
  std::string_view name;
  Quantity quantity;
};

/// The measures that this kind of recording has.
std::vector<Measure> measures(MeasurementKind kind) {
  std::vector<Measure> list;
  if (kind == MeasurementKind::kCorners) {
    list.push_back({"px", "corner in the image, px", Quantity::kPixels});
    list.push_back({"m", "marker across the line of sight, mm", Quantity::kLength});
    list.push_back({"rad", "marker about the line of sight, °", Quantity::kAngle});
  } else {
    list.push_back({"m", "position, mm", Quantity::kLength});
    if (kind == MeasurementKind::kPose) list.push_back({"rad", "rotation, °", Quantity::kAngle});
  }
  return list;
}

struct State {
  std::string_view key;
  std::string_view name;
};

std::vector<State> states(const RunSummary& run) {
  return {
      {"before", run.nominal ? "before (nominal geometry)" : "before (structure, no refinement)"},
      {"training", "after, training"},
      {"held_out", "after, held out"}};
}

/// What each freedom of a nominal robot predicts.
std::string levels_table(const Facts& facts) {
  const std::vector<FreedomLevel>& levels = facts.run.levels;
  if (levels.empty()) return "";
  Table table("levels-table",
              "The nominal robot at postures not seen: root mean square error, and the logarithm "
              "of the odds against the one that is exported",
              facts.result);
  std::vector<std::string> head = {"What is free"};
  for (const Measure& measure : measures(facts.run.calibration.kind))
    head.emplace_back(measure.name);
  head.insert(head.end(), {"Log odds", "Exported"});
  table.header(head);
  for (std::size_t k = 0; k < levels.size(); ++k) {
    const std::string at = fmt::format("/nominal_levels/{}", k);
    table.begin_row();
    table.text(words_of(levels[k]));
    for (const Measure& measure : measures(facts.run.calibration.kind))
      table.number(fmt::format("{}/held_out_{}/rms", at, measure.key), measure.quantity);
    table.number(at + "/log_odds", Quantity::kPlain);
    table.text(levels[k].exported ? "yes" : "");
  }
  return table.str();
}

std::string overall_table(const Facts& facts) {
  Table table("errors-table", "Length of the error vector, all markers", facts.result);
  table.header({"Measure", "Model", "Count", "Rms", "Median", "95 %", "Largest"});
  for (const Measure& measure : measures(facts.run.calibration.kind)) {
    for (const State& state : states(facts.run)) {
      const std::string at = fmt::format("/errors/all/{}_{}", state.key, measure.key);
      table.begin_row();
      table.text(measure.name);
      table.text(state.name);
      table.number(at + "/count", Quantity::kCount);
      for (const std::string_view statistic : {"rms", "median", "p95", "max"}) {
        table.number(fmt::format("{}/{}", at, statistic), measure.quantity);
      }
    }
  }
  return table.str();
}

/// What recordings say beside one another.
std::string recordings_table(const Facts& facts) {
  const std::vector<RecordingSummary>& recordings = facts.run.recordings;
  if (recordings.empty()) return "";
  const bool corners = facts.run.calibration.kind == MeasurementKind::kCorners;
  const Quantity quantity = corners ? Quantity::kPixels : Quantity::kLength;
  const std::string unit = corners ? "px" : "mm";
  Table table("recordings-table",
              "The recordings: rms at postures not seen by the model of all (repeatability within "
              "a recording), and by the robot that the other recordings show, camera, markers and "
              "clock placed by the recording's own other postures (accuracy)",
              facts.result);
  table.header({"Recording", "Sightings used", "Log time = frame time + offset, ms", "U, ms",
                "By all, " + unit, "By the others, " + unit, "Markers stuck on anew"});
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    const std::string at = fmt::format("/recordings/each/{}", k);
    table.begin_row();
    table.text(recordings[k].name);
    table.number(at + "/sightings_used", Quantity::kCount);
    table.value(at + "/time_offset_s", at + "/time_offset_expanded_s", Quantity::kDelay);
    table.uncertainty(at + "/time_offset_expanded_s", Quantity::kDelay, "held");
    table.number(at + "/held_out_rms", quantity);
    table.number(at + "/by_others_rms", quantity);
    std::string anew;
    for (const MarkerAnew& marker : recordings[k].anew)
      anew += fmt::format("{}tag_{} (tag_{})", anew.empty() ? "" : ", ", marker.id.value,
                          marker.renamed.value);
    table.text(anew);
  }
  const auto scatter = recording_scatter(facts.run);
  if (!scatter) return table.str();
  return table.str() +
         paragraph(fmt::format(
             "Between recordings there is a scatter of {} beyond that within them: {} against {}.",
             text_with_unit(scatter->between_rms, quantity),
             text_with_unit(scatter->unseen_rms, quantity),
             text_with_unit(scatter->within_rms, quantity)));
}

std::string rows_table(const Facts& facts, std::string_view id, std::string_view caption,
                       std::string_view list, const std::vector<ErrorRow>& rows) {
  Table table(id, caption, facts.result);
  std::vector<std::string> head = {list == "links" ? "Link" : "Marker", "Sightings"};
  const std::vector<Measure> all = measures(facts.run.calibration.kind);
  for (const Measure& measure : all) {
    const std::string unit(display_unit(measure.quantity).text);
    head.insert(head.end(), {"Before, " + unit, "Training, " + unit, "Held out, " + unit});
  }
  head.push_back(fmt::format("Largest held out, {}", display_unit(all.front().quantity).text));
  table.header(head);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const std::string at = fmt::format("/errors/{}/{}", list, k);
    table.begin_row();
    table.text(rows[k].name);
    table.number(at + "/training_m/count", Quantity::kCount);
    for (const Measure& measure : all) {
      for (const State& state : states(facts.run)) {
        table.number(fmt::format("{}/{}_{}/rms", at, state.key, measure.key), measure.quantity);
      }
    }
    table.number(fmt::format("{}/held_out_{}/max", at, all.front().key), all.front().quantity);
  }
  return table.str();
}

/// Lengths of the errors of one state, sorted.
std::vector<double> lengths(const Calibration& calibration, std::string_view state) {
  std::vector<double> result;
  for (const SightingResidual& sighting : calibration.residuals) {
    if (!sighting.used) continue;
    if (calibration.kind == MeasurementKind::kCorners) {
      const auto& corners = state == "before"     ? sighting.before_px
                            : state == "training" ? sighting.corners_px
                                                  : sighting.held_out_px;
      for (const Eigen::Vector2d& corner : corners) result.push_back(corner.norm());
    } else {
      const Vector6d& shift = state == "before"     ? sighting.before_displacement
                              : state == "training" ? sighting.displacement
                                                    : sighting.held_out_displacement;
      if (!shift.isZero(0.0)) result.push_back(1000.0 * shift.tail<3>().norm());
    }
  }
  std::erase_if(result, [](double length) { return !(length > 0.0) || !std::isfinite(length); });
  std::ranges::sort(result);
  return result;
}

/// Empirical distribution of the error's length, on a logarithmic scale, thinned to its shape.
std::string distribution_plot(const Facts& facts) {
  const bool corners = facts.run.calibration.kind == MeasurementKind::kCorners;
  double low = 1e300, high = 0.0;
  std::vector<std::vector<double>> all;
  for (const State& state : states(facts.run)) {
    all.push_back(lengths(facts.run.calibration, state.key));
    if (all.back().empty()) continue;
    low = std::min(low, all.back()[all.back().size() / 50]);
    high = std::max(high, all.back().back());
  }
  if (!(high > low)) return "";
  const double unit_low = std::log10(low), unit_high = std::log10(high);
  Plot plot("Share of errors below a length",
            {.label = corners ? "error, px" : "error, mm",
             .lower = unit_low,
             .upper = unit_high,
             .log10 = true},
            {.label = "share below, %", .lower = 0.0, .upper = 100.0},
            {.width = 460.0, .height = 240.0});
  constexpr std::size_t kSteps = 200;
  for (std::size_t s = 0; s < all.size(); ++s) {
    const std::vector<double>& sorted = all[s];
    if (sorted.empty()) continue;
    std::vector<Eigen::Vector2d> curve;
    for (std::size_t k = 0; k <= kSteps; ++k) {
      const std::size_t i = k * (sorted.size() - 1) / kSteps;
      curve.emplace_back(std::log10(sorted[i]),
                         100.0 * static_cast<double>(i + 1) / static_cast<double>(sorted.size()));
    }
    const std::string css = series_class(s) + (s == 2 ? " dashed" : "");
    plot.line(curve, css);
    plot.legend(states(facts.run)[s].name, css);
  }
  return plot.str();
}

}  // namespace

std::string errors_section(const Facts& facts) {
  std::string out = section_head("errors", "Errors before and after");
  out += paragraph(
      "Held out: predicted by a model that was fitted without that part of the recording. Outliers "
      "left out of the "
      "fit are in none of these figures; they are counted under data quality.");
  out += levels_table(facts) + overall_table(facts) + recordings_table(facts);
  const std::string plot = distribution_plot(facts);
  if (!plot.empty()) out += figure(plot, "Distribution of the error's length.", "half");
  out += rows_table(facts, "errors-links-table", "Rms of the error, per link", "links",
                    facts.run.errors.links);
  out += rows_table(facts, "errors-markers-table", "Rms of the error, per marker", "markers",
                    facts.run.errors.markers);
  return out + "</section>\n";
}

}  // namespace kinescope::report
