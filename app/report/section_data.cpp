// SPDX-License-Identifier: Apache-2.0
//
// Data quality: what was seen when, how large, what was left out, what the log holds.
#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/plot.h"
#include "app/report/sections.h"
#include "app/report/trace_lines.h"

namespace kinescope::report {
namespace {

constexpr double kTimelineWidth = 940.0;
constexpr double kTimelineRow = 18.0;
constexpr double kTimelineBarHalf = 0.32;

/// Frames in which a marker was seen, and those in which its sighting was left out.
struct Sightings {
  std::set<int> seen;
  std::set<int> left_out;
};

std::map<TagId, Sightings> sightings_of(const RunSummary& run) {
  std::map<TagId, Sightings> all;
  for (const PoseTrack& track : run.tracks.tracks) {
    for (const PoseSample& sample : track.samples) all[track.id].seen.insert(sample.frame);
  }
  for (const SightingResidual& sighting : run.calibration.residuals) {
    all[sighting.id].seen.insert(sighting.frame);
    if (!sighting.used) all[sighting.id].left_out.insert(sighting.frame);
  }
  return all;
}

const std::vector<double>& frame_times(const RunSummary& run) {
  return run.calibration.times_s.empty() ? run.tracks.times_s : run.calibration.times_s;
}

/// Draws the frames as bars, consecutive ones as one.
void draw_runs(Plot& plot, const std::set<int>& frames, const std::vector<double>& times,
               double row, std::string_view css_class) {
  const auto count = static_cast<int>(times.size());
  const auto start = [&](int frame) {
    const auto i = static_cast<std::size_t>(frame);
    return frame == 0 ? times[i] : 0.5 * (times[i - 1] + times[i]);
  };
  const auto end = [&](int frame) {
    const auto i = static_cast<std::size_t>(frame);
    return frame + 1 >= count ? times[i] : 0.5 * (times[i] + times[i + 1]);
  };
  for (auto it = frames.begin(); it != frames.end();) {
    const int first = *it;
    int last = first;
    for (++it; it != frames.end() && *it == last + 1; ++it) last = *it;
    if (first < 0 || last >= count) continue;
    plot.bar(start(first), end(last), row - kTimelineBarHalf, row + kTimelineBarHalf, css_class);
  }
}

std::string timeline(const Facts& facts) {
  const std::vector<double>& times = frame_times(facts.run);
  const std::map<TagId, Sightings> sightings = sightings_of(facts.run);
  if (times.size() < 2 || sightings.empty()) return "";
  const double rows = static_cast<double>(sightings.size());
  std::vector<std::string> names;
  for (const auto& [id, frames] : sightings) names.push_back(marker_name(id));
  Plot plot("When each marker was seen",
            {.label = "time, s", .lower = times.front(), .upper = times.back(), .ticks = 10},
            {.label = "", .lower = -0.6, .upper = rows - 0.4, .down = true, .row_names = names},
            {.width = kTimelineWidth, .height = 50.0 + kTimelineRow * rows});
  plot.is_time_axis();
  double row = 0.0;
  for (const auto& [id, frames] : sightings) {
    draw_runs(plot, frames.seen, times, row, "seen");
    draw_runs(plot, frames.left_out, times, row, "left-out");
    row += 1.0;
  }
  plot.legend("seen", "seen");
  plot.legend("left out of the fit as an outlier", "left-out");
  return plot.str();
}

std::string marker_table(const Facts& facts) {
  const bool corners = facts.run.calibration.kind == MeasurementKind::kCorners;
  Table table("markers-table", corners ? "Markers in the images" : "Markers", facts.result);
  std::vector<std::string> head = {"Marker", "On link", "Frames seen", "Seen, %"};
  if (corners) {
    head.insert(head.end(),
                {"Edge, mm", "Edge in the image, px (median)", "Corner noise expected, px"});
  }
  head.insert(head.end(), {"Sightings used", "Left out"});
  table.header(head);
  for (std::size_t k = 0; k < facts.run.markers.size(); ++k) {
    const MarkerSummary& marker = facts.run.markers[k];
    const std::string at = fmt::format("/data/markers/{}", k);
    table.begin_row();
    table.text(marker_name(marker.id));
    table.text(marker_link(facts.run.calibration.tree, marker.id));
    table.number(at + "/frames_seen", Quantity::kCount);
    table.number(at + "/share_seen", Quantity::kPercent);
    if (corners) {
      table.number(at + "/size_m", Quantity::kLength);
      table.number(at + "/median_edge_px", Quantity::kPixels);
      table.number(at + "/median_sigma_px", Quantity::kPixels);
    }
    const auto& tree_markers = facts.run.calibration.tree.markers;
    const auto found = std::ranges::find(tree_markers, marker.id, &Marker::id);
    const std::string in_fit = fmt::format("/calibration/markers/{}", found - tree_markers.begin());
    table.number(in_fit + "/used", Quantity::kCount);
    table.number(in_fit + "/rejected", Quantity::kCount);
  }
  return table.str();
}

std::string channel_table(const Facts& facts) {
  if (facts.run.log.empty()) {
    return paragraph("The recording holds no joint log.", "note");
  }
  Table table("channels-table", "Channels of the joint log, in their own units", facts.result);
  table.header({"Channel", "Samples", "Lowest", "Highest", "Lowest while filmed",
                "Highest while filmed", "Drives"});
  for (std::size_t k = 0; k < facts.run.log.channels.size(); ++k) {
    const std::string at = fmt::format("/data/channels/{}", k);
    const nlohmann::json& channel = facts.result.at(nlohmann::json::json_pointer(at));
    table.begin_row();
    table.text(facts.run.log.channels[k]);
    table.number(at + "/samples", Quantity::kCount);
    table.number(at + "/min", Quantity::kChannel);
    table.number(at + "/max", Quantity::kChannel);
    table.number(at + "/filmed_min", Quantity::kChannel);
    table.number(at + "/filmed_max", Quantity::kChannel);
    const auto joint = channel.at("joint").get<std::string>();
    const bool idle = channel.at("idle").get<bool>();
    table.text(!joint.empty() ? joint : idle ? "nothing (idle)" : "–");
  }
  return table.str();
}

std::string rejected_table(const Facts& facts) {
  if (facts.run.rejected.empty()) {
    return paragraph("No detection was rejected.", "note");
  }
  Table table("rejected-table", "Detections rejected", facts.result);
  table.header({"Reason", "Count"});
  for (std::size_t k = 0; k < facts.run.rejected.size(); ++k) {
    table.begin_row();
    table.text(facts.run.rejected[k].first);
    table.number(fmt::format("/data/rejected/{}/count", k), Quantity::kCount);
  }
  return table.str();
}

/// Nothing where every frame counts.
std::string independent_words(const Facts& facts) {
  if (facts.analysis.independent_frames >= facts.run.frames) return "";
  return "; because residuals are correlated in time they count as about " +
         inline_number(facts.result, "/data/independent_frames", Quantity::kCount) +
         " independent ones";
}

}  // namespace

std::string data_section(const Facts& facts) {
  std::string out = section_head("data", "Data quality");
  out += "<p>" + inline_number(facts.result, "/data/frames", Quantity::kCount) + " frames over " +
         inline_number(facts.result, "/data/duration_s", Quantity::kTime) +
         independent_words(facts) + ".";
  if (facts.run.calibration.kind == MeasurementKind::kCorners) {
    out += " The corners cover " +
           inline_number(facts.result, "/data/image_coverage", Quantity::kPercent) +
           " of the image (cells of an 8 × 6 grid).";
    if (!facts.run.camera_declared) out += " The camera was not declared.";
  }
  out += "</p>\n";
  const std::string lines = timeline(facts);
  if (!lines.empty()) out += figure(lines, "When each marker was seen.", "wide");
  out += marker_table(facts) + "<div class=\"columns\">" + channel_table(facts) +
         rejected_table(facts) + "</div>\n";
  if (!facts.run.second_columns.empty()) {
    out += "<h3>Second columns of a joint</h3><ul id=\"second-columns\">";
    for (const std::string& line : second_column_lines(facts.run.second_columns))
      out += "<li>" + escaped(line) + "</li>";
    out += "</ul>\n";
  }
  if (!facts.run.warnings.empty()) {
    out += "<h3>Warnings</h3><ul id=\"warnings\">";
    for (const std::string& warning : facts.run.warnings)
      out += "<li>" + escaped(warning) + "</li>";
    out += "</ul>\n";
  }
  return out + "</section>\n";
}

}  // namespace kinescope::report
