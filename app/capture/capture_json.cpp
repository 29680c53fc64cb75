// SPDX-License-Identifier: Apache-2.0
#include "app/capture/capture_json.h"

#include "app/report/result_values.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

using nlohmann::json;

json texts(const std::vector<std::string>& lines) {
  json out = json::array();
  for (const std::string& line : lines) out.push_back(report::text(line));
  return out;
}

json markers_json(const CaptureGuide& guide) {
  json out = json::array();
  for (const auto& [id, tally] : guide.markers) {
    out.push_back({{"id", id.value},
                   {"frames", tally.frames},
                   {"used", tally.used},
                   {"edge_px", median_of(tally.edges_px)},
                   {"contrast", median_of(tally.contrasts)},
                   {"blur_px", median_of(tally.blurs_px)},
                   {"most_tilt_deg", tally.most_tilt_deg}});
  }
  return out;
}

json channels_json(const CaptureGuide& guide) {
  json out = json::array();
  for (const ChannelTally& channel : guide.channels) {
    out.push_back({{"channel", report::text(channel.name)},
                   {"unit", guess_unit(channel.span)},
                   {"lower", channel.span.lower},
                   {"upper", channel.span.upper}});
  }
  return out;
}

json refused_json(const CaptureGuide& guide) {
  json out = json::object();
  for (const auto& [refusal, frames] : guide.refused) out[to_string(refusal)] = frames;
  return out;
}

}  // namespace

json capture_json(const CaptureStatus& status) {
  const CaptureGuide& guide = status.guide;
  return {{"source", report::text(status.source)},
          {"folder", report::text(status.folder)},
          {"family", status.family},
          {"stamps", status.stamps},
          {"end", report::text(status.end)},
          {"frames", status.recorded},
          {"seconds", status.seconds},
          {"examined", guide.frames},
          {"used", guide.used},
          {"refused", refused_json(guide)},
          {"markers", markers_json(guide)},
          {"grid", {{"columns", kGridColumns}, {"rows", kGridRows}, {"counts", guide.grid}}},
          {"coverage", covered_share(guide.grid)},
          {"joint_rows", guide.rows},
          {"joint_stamps", status.joint_stamps},
          {"joints", channels_json(guide)},
          {"missing", texts(status.missing)},
          {"warnings", texts(status.warnings)}};
}

json live_json(const CaptureStatus& status, const FrameView& now) {
  json out = capture_json(status);
  out["phase"] = status.phase;
  json markers = json::array();
  for (const MarkerView& view : now.markers) {
    json corners = json::array();
    for (const Eigen::Vector2d& corner : view.tag.corners_px)
      corners.push_back({corner.x(), corner.y()});
    markers.push_back({{"id", view.tag.id.value},
                       {"corners", corners},
                       {"edge_px", view.edge_px},
                       {"tilt_deg", view.tilt_deg},
                       {"refusal", to_string(view.refusal)}});
  }
  out["now"] = {{"width", now.width},
                {"height", now.height},
                {"refusal", to_string(now.refusal)},
                {"markers", markers}};
  return out;
}

}  // namespace kinescope
