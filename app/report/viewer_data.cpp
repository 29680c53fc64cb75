// SPDX-License-Identifier: Apache-2.0
//
// What the 3-D view plays. Thinned to at most kMostFrames frames and rounded to what a screen
// shows, so that 33 s of seven markers take about half a megabyte.
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/prediction.h"
#include "app/report/sections.h"
#include "kinematics/core/text.h"

namespace kinescope::report {
namespace {

constexpr std::size_t kMostFrames = 600;
constexpr double kMost =
    400000.0;  ///< residual numbers in all; markers beyond are thinned by frame

/// Short text of a finite number; null else. JSON wants no leading plus and no bare point.
std::string rounded(double value, int decimals) {
  if (!std::isfinite(value)) return "null";
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.find('.') != std::string::npos) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.ends_with('.')) text.pop_back();
  }
  return text == "-0" ? "0" : text;
}

std::string list(const std::vector<double>& values, int decimals) {
  std::string text = "[";
  for (const double value : values) text += (text.size() > 1 ? "," : "") + rounded(value, decimals);
  return text + "]";
}

/// Quaternion w x y z, then translation.
std::string pose_list(const Pose& T) {
  const Eigen::Quaterniond& q = T.rotation;
  return list({q.w(), q.x(), q.y(), q.z(), T.translation.x(), T.translation.y(), T.translation.z()},
              6);
}

/// A JSON string that cannot end the script element it stands in.
std::string json_string(std::string_view text) {
  std::string out = nlohmann::json(clean_text(text)).dump();
  for (std::size_t at = out.find('<'); at != std::string::npos; at = out.find('<', at)) {
    out.replace(at, 1, "\\u003c");
  }
  return out;
}

std::string joints_text(const KinematicTree& tree) {
  std::string out = "[";
  for (const Joint& joint : tree.joints) {
    out += fmt::format(
        "{}{{\"name\":{},\"type\":\"{}\",\"parent\":{},\"child\":{},\"origin\":{},\"axis\":{}}}",
        out.size() > 1 ? "," : "", json_string(joint.name), kinescope::to_string(joint.type),
        joint.parent.value, joint.child.value, pose_list(joint.T_parent_joint),
        list({joint.axis.x(), joint.axis.y(), joint.axis.z()}, 6));
  }
  return out + "]";
}

std::string markers_text(const KinematicTree& tree) {
  std::string out = "[";
  for (const Marker& marker : tree.markers) {
    out += fmt::format("{}{{\"id\":{},\"link\":{},\"mount\":{},\"size\":{}}}",
                       out.size() > 1 ? "," : "", marker.id.value, marker.link.value,
                       pose_list(marker.T_link_marker), rounded(marker.size_m, 5));
  }
  return out + "]";
}

std::string camera_text(const Calibration& calibration, std::size_t c) {
  const CameraModel& camera = calibration.model_of_camera(c);
  return fmt::format(
      "{{\"pose\":{},\"width\":{},\"height\":{},\"fx\":{},\"fy\":{},\"cx\":{},\"cy\":{}}}",
      pose_list(calibration.T_camera_base_of(c).inverse()), camera.width, camera.height,
      rounded(camera.fx, 3), rounded(camera.fy, 3), rounded(camera.cx, 3), rounded(camera.cy, 3));
}

/// Of several cameras all of them, and which one each frame is of; nothing of one.
std::string cameras_text(const Calibration& calibration, const std::vector<std::size_t>& shown) {
  if (calibration.cameras() < 2) return "";
  std::string cameras, of_frames;
  for (std::size_t c = 0; c < calibration.cameras(); ++c)
    cameras += (c == 0 ? "" : ",") + camera_text(calibration, c);
  for (const std::size_t frame : shown)
    of_frames += fmt::format("{}{}", of_frames.empty() ? "" : ",",
                             calibration.camera_at(static_cast<int>(frame)));
  return fmt::format("\"cameras\":[{}],\"cameraOf\":[{}],", cameras, of_frames);
}

/// The residual of a sighting: marker's place in the tree, 0 or 1 for used, then px (corners) or m.
std::string residual_text(const Calibration& calibration, const SightingResidual& sighting) {
  const auto& markers = calibration.tree.markers;
  const auto found = std::ranges::find(markers, sighting.id, &Marker::id);
  if (found == markers.end()) return "";
  std::string out = fmt::format("[{},{}", found - markers.begin(), sighting.used ? 1 : 0);
  if (calibration.kind == MeasurementKind::kCorners) {
    if (sighting.corners_px.size() != 4) return "";
    for (const Eigen::Vector2d& corner : sighting.corners_px) {
      out += "," + rounded(corner.x(), 3) + "," + rounded(corner.y(), 3);
    }
  } else {
    for (int k = 3; k < 6; ++k) out += "," + rounded(sighting.displacement(k), 6);
  }
  return out + "]";
}

std::size_t frame_stride(const Calibration& calibration) {
  const std::size_t frames = calibration.times_s.size();
  const std::size_t by_frames = (frames + kMostFrames - 1) / kMostFrames;
  const double numbers = 10.0 * static_cast<double>(calibration.residuals.size());
  const auto by_numbers = static_cast<std::size_t>(std::ceil(numbers / kMost));
  return std::max<std::size_t>({1, by_frames, by_numbers});
}

}  // namespace

std::string viewer_data(const Facts& facts) {
  const Calibration& calibration = facts.run.calibration;
  std::map<int, std::string> residuals;
  for (const SightingResidual& sighting : calibration.residuals) {
    const std::string one = residual_text(calibration, sighting);
    if (one.empty()) continue;
    std::string& frame = residuals[sighting.frame];
    frame += (frame.empty() ? "" : ",") + one;
  }
  const std::size_t stride = frame_stride(calibration);
  std::vector<double> times;
  std::vector<std::size_t> shown;
  std::string values, arrows;
  for (std::size_t frame = 0; frame < calibration.times_s.size(); frame += stride) {
    const auto row = static_cast<Eigen::Index>(frame);
    if (row >= calibration.joint_values.rows()) break;
    times.push_back(calibration.times_s[frame]);
    shown.push_back(frame);
    std::vector<double> posture;
    for (Eigen::Index j = 0; j < calibration.joint_values.cols(); ++j) {
      const bool fixed =
          calibration.tree.joints[static_cast<std::size_t>(j)].type == JointType::kFixed;
      posture.push_back(fixed ? 0.0 : calibration.joint_values(row, j));
    }
    values += (values.empty() ? "" : ",") + list(posture, 5);
    arrows += fmt::format("{}[{}]", arrows.empty() ? "" : ",", residuals[static_cast<int>(frame)]);
  }
  return fmt::format(
      "{{\"kind\":\"{}\",\"baseIsCamera\":{},\"stride\":{},\"links\":{},\"joints\":{},\"markers\":{"
      "},\"camera\":{},{}"
      "\"times\":{},\"values\":[{}],\"residuals\":[{}]}}",
      to_string(calibration.kind), base_is_camera(calibration), stride,
      calibration.tree.links.size(), joints_text(calibration.tree), markers_text(calibration.tree),
      camera_text(calibration, 0), cameras_text(calibration, shown), list(times, 4), values,
      arrows);
}

std::string viewer_panel() {
  return R"(<div id="viewer" hidden>
<div id="viewer-canvas" tabindex="0" aria-label="3-D view of the robot"></div>
<div id="viewer-controls">
<button type="button" id="viewer-play" title="Space">Play</button>
<input type="range" id="viewer-time" min="0" max="0" value="0" step="1" aria-label="Time">
<output id="viewer-clock"></output>
<label>Residuals <input type="range" id="viewer-scale" min="0" max="4" step="0.05" aria-label="Scale of the residual arrows"></label>
<output id="viewer-scale-text"></output>
<button type="button" id="viewer-camera" title="C">Camera's view</button>
<button type="button" id="viewer-reset" title="R">Reset view</button>
</div>
</div>
)";
}

std::string view_section(const Facts& facts) {
  return section_head("view", "The robot") + robot_views(facts) +
         "<p class=\"note\">The 3-D view above: drag turns, right drag moves, wheel zooms (after a "
         "click). Space plays, arrow keys step, Home and End jump, + and - scale the residual "
         "arrows. A click on a plot over time goes there.</p></section>\n";
}

}  // namespace kinescope::report
