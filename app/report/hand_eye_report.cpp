// SPDX-License-Identifier: Apache-2.0
//
// The page of a hand-eye calibration.
#include <algorithm>

#include <fmt/format.h>

#include "app/report/hand_eye_summary.h"
#include "app/report/html.h"
#include "app/report/page.h"
#include "app/report/plot.h"
#include "app/report/reproduction.h"
#include "app/report/sections.h"
#include "app/report/trace_lines.h"
#include "app/report/trace_section.h"

namespace kinescope::report {
namespace {

std::vector<ContentsEntry> hand_eye_contents(const HandEyeSummary& summary) {
  std::vector<ContentsEntry> out{{"verdict", "Verdict"},
                                 {"transforms", "Transforms"},
                                 {"poses", "Errors by pose"},
                                 {"readings", "Readings of the log"}};
  if (summary.hand_eye.trace) out.push_back({"trace", "Closing the loop"});
  out.push_back({"urdf", "URDF"});
  out.push_back({"reproduce", "How to reproduce"});
  return out;
}

std::string sentence(const std::string& words) {
  return words.empty() ? "" : paragraph(words + ".");
}

std::string verdict_section(const HandEyeSummary& summary) {
  const Verdict verdict = hand_eye_verdict(summary);
  std::string out = section_head("verdict", "Verdict");
  for (const std::string& words : {verdict.found, verdict.accurate, verdict.limits, verdict.next})
    out += sentence(words);
  if (summary.hand_eye.trace)
    for (const std::string& line : trace_lines(*summary.hand_eye.trace)) out += paragraph(line);
  for (const std::string& line : odd_row_lines(summary)) out += paragraph(line, "note");
  for (const std::string& line : summary.run.warnings) out += paragraph(line, "note");
  return out + "</section>\n";
}

void transform_row(Table& table, const std::string& name, const std::string& at) {
  table.begin_row();
  table.text(name);
  for (int k = 0; k < 3; ++k)
    table.value(fmt::format("{}/translation_m/{}", at, k), at + "/translation_expanded_m",
                Quantity::kLength);
  table.uncertainty(at + "/translation_expanded_m", Quantity::kLength);
  for (int k = 0; k < 3; ++k)
    table.value(fmt::format("{}/rpy_rad/{}", at, k), at + "/rotation_expanded_rad",
                Quantity::kAngle);
  table.uncertainty(at + "/rotation_expanded_rad", Quantity::kAngle);
}

std::string transforms_section(const HandEyeSummary& summary, const nlohmann::json& document) {
  const bool on_hand = summary.hand_eye.hypothesis.mount == CameraMount::kOnHand;
  std::string out = section_head("transforms", "Transforms");
  out += paragraph(
      "Roll, pitch and yaw are those of URDF (fixed axes). The camera looks along z, x to the "
      "right, y down. Covariances are in hand_eye.json.");
  Table table("transforms-table", "Estimated transforms, with expanded uncertainty (k = 2)",
              document);
  table.header(
      {"Transform", "x, mm", "y, mm", "z, mm", "±, mm", "Roll, °", "Pitch, °", "Yaw, °", "±, °"});
  transform_row(table, on_hand ? "camera in the flange" : "camera in the base", "/camera");
  for (std::size_t k = 0; k < summary.hand_eye.targets.size(); ++k) {
    transform_row(table,
                  fmt::format("tag_{} in the {}", summary.hand_eye.targets[k].id.value,
                              on_hand ? "base" : "flange"),
                  fmt::format("/targets/{}", k));
  }
  return out + table.str() + "</section>\n";
}

// Held-out errors over the poses; those left out apart.
std::string error_plot(const HandEyeSummary& summary, std::string_view name, std::string_view unit,
                       double factor, double HandEyeError::* part) {
  std::vector<Eigen::Vector2d> held_out;
  std::vector<Eigen::Vector2d> left_out;
  double top = 0.0;
  double first = summary.hand_eye.frames.front().time_s;
  double last = summary.hand_eye.frames.back().time_s;
  for (const HandEyeFrame& frame : summary.hand_eye.frames) {
    if (!frame.held_out) {
      left_out.emplace_back(frame.time_s, 0.0);
      continue;
    }
    held_out.emplace_back(frame.time_s, factor * ((*frame.held_out).*part));
    top = std::max(top, held_out.back().y());
  }
  double low = 0.0;
  pad_range(first, last, 0.02);
  pad_range(low, top, 0.1);
  Plot plot(fmt::format("Held-out error of {} over the poses", name),
            {.label = summary.time_column, .lower = first, .upper = last},
            {.label = fmt::format("{}, {}", name, unit), .lower = 0.0, .upper = top},
            {.width = 940.0, .height = 180.0});
  plot.dots(held_out, series_class(0));
  plot.legend("held out", series_class(0));
  if (!left_out.empty()) {
    plot.dots(left_out, series_class(1));
    plot.legend("left out", series_class(1));
  }
  return figure(plot.str(), "", "wide");
}

std::string poses_section(const HandEyeSummary& summary) {
  std::string out = section_head("poses", "Errors by pose");
  out += paragraph(
      "How far the markers are from where they are predicted, each pose with its fold held out of "
      "the fit: neighbours in posture are held out together.");
  if (summary.hand_eye.frames.empty()) return out + "</section>\n";
  out += error_plot(summary, "position", "mm", 1e3, &HandEyeError::m);
  out += error_plot(summary, "rotation", "°", kDegreesPerRadian, &HandEyeError::rad);
  return out + "</section>\n";
}

std::string readings_section(const HandEyeSummary& summary, const nlohmann::json& document) {
  std::string out = section_head("readings", "Readings of the log");
  out += paragraph(
      "Rival readings of the same files, each fitted and judged by its predictive likelihood at "
      "poses that it has not seen. A camera on the hand whose log is the flange in the base's "
      "frame and a fixed camera whose log is the base in the flange's frame are one equation: "
      "between those two what is usual decides (short brackets, base to flange), or camera_mount "
      "in recording.yaml.");
  Table table("readings-table", "Readings; the score is the log predictive density less the best",
              document);
  table.header(
      {"Camera", "Log", "Rotation", "Held out, mm", "Held out, °", "Score", "Probability"});
  for (std::size_t k = 0; k < summary.hand_eye.rivals.size(); ++k) {
    const HandEyeRival& rival = summary.hand_eye.rivals[k];
    const std::string at = fmt::format("/rivals/{}", k);
    table.begin_row();
    table.text(rival.hypothesis.mount == CameraMount::kOnHand ? "on the hand" : "fixed");
    table.text(rival.hypothesis.direction == PoseDirection::kBaseFlange ? "flange in the base"
                                                                        : "base in the flange");
    table.text(rival.hypothesis.rotation);
    table.number(at + "/held_out/m", Quantity::kLength);
    table.number(at + "/held_out/rad", Quantity::kAngle);
    table.number(at + "/log_score", Quantity::kPlain);
    table.text(probability_text(rival.probability));
  }
  return out + table.str() + "</section>\n";
}

}  // namespace
}  // namespace kinescope::report

namespace kinescope {

std::string hand_eye_report_html(const HandEyeSummary& summary, std::string_view urdf) {
  using namespace report;
  const nlohmann::json document = hand_eye_json(summary);
  std::string out = page_begin("hand-eye report", summary.run.robot, summary.run.recording,
                               summary.run.version, hand_eye_contents(summary));
  out += "<main>\n" + verdict_section(summary) + transforms_section(summary, document) +
         poses_section(summary) + readings_section(summary, document);
  if (summary.hand_eye.trace) out += trace_section(*summary.hand_eye.trace);
  out += section_head("urdf", "URDF") + "<pre>" + escaped(urdf) + "</pre></section>\n";
  Reproduction reproduction{.command = summary.run.command,
                            .settings = summary.run.options,
                            .inputs = summary.run.inputs,
                            .products = {{"hand_eye.json", "every number of this page"},
                                         {"hand_eye.urdf", "the camera's frames"}}};
  return out + reproduction_section(reproduction) + "</main>\n</body>\n</html>\n";
}

}  // namespace kinescope
