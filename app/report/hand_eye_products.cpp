// SPDX-License-Identifier: Apache-2.0
//
// hand_eye.json, and the sentences that tell of it.
#include <cmath>

#include <fmt/format.h>

#include "app/report/hand_eye_summary.h"
#include "app/report/numbers.h"
#include "app/report/result_values.h"

namespace kinescope {
namespace {

using nlohmann::json;

constexpr double kExpanded = 2.0;  // coverage factor

json matrix_json(const Eigen::MatrixXd& m) {
  json out = json::array();
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    json row = json::array();
    for (Eigen::Index k = 0; k < m.cols(); ++k) row.push_back(report::number(m(i, k)));
    out.push_back(std::move(row));
  }
  return out;
}

// The largest standard uncertainty over all directions.
double worst_sigma(const Eigen::Matrix3d& covariance) {
  const Eigen::Vector3d variances = covariance.diagonal();
  return std::sqrt(std::max(0.0, variances.maxCoeff()));
}

json uncertain_json(const UncertainPose& pose, std::string_view frame) {
  const Eigen::Matrix3d turn = pose.covariance.topLeftCorner<3, 3>();
  const Eigen::Matrix3d shift = pose.covariance.bottomRightCorner<3, 3>();
  json out = report::pose(pose.T);
  out["frame"] = frame;
  out["covariance"] = matrix_json(pose.covariance);
  out["rotation_expanded_rad"] = report::number(kExpanded * worst_sigma(turn));
  out["translation_expanded_m"] = report::number(kExpanded * worst_sigma(shift));
  return out;
}

json error_json(const HandEyeError& error) {
  json out{{"m", report::number(error.m)},
           {"rad", report::number(error.rad)},
           {"px", nullptr},
           {"poses", error.frames}};
  if (error.px > 0.0) out["px"] = report::number(error.px);
  return out;
}

json rival_json(const HandEyeRival& rival) {
  return {{"camera_mount", to_string(rival.hypothesis.mount)},
          {"log_direction", to_string(rival.hypothesis.direction)},
          {"log_rotation", rival.hypothesis.rotation},
          {"held_out", error_json(rival.held_out)},
          {"log_score", report::number(rival.log_score)},
          {"probability", report::number(rival.probability)},
          {"same_equation", rival.same_equation}};
}

json odd_row_json(const OddFlangeRow& row) {
  json out{{"time", row.time_s},
           {"line", nullptr},
           {"read", report::pose(row.read)},
           {"expected", report::pose(row.expected)},
           {"shift_m", report::number(row.shift_m)},
           {"turn_rad", report::number(row.turn_rad)}};
  if (row.line) out["line"] = *row.line;
  return out;
}

json frame_json(const HandEyeFrame& frame) {
  json out{{"time", frame.time_s},
           {"fold", frame.fold},
           {"used", frame.used},
           {"fitted", error_json(frame.fitted)},
           {"held_out", nullptr}};
  if (frame.held_out) out["held_out"] = error_json(*frame.held_out);
  return out;
}

template <typename Value, typename Write>
json list_json(const std::vector<Value>& values, const Write& write) {
  json out = json::array();
  for (const Value& value : values) out.push_back(write(value));
  return out;
}

bool on_hand(const HandEye& result) { return result.hypothesis.mount == CameraMount::kOnHand; }
const char* camera_frame(const HandEye& result) { return on_hand(result) ? "flange" : "base"; }
const char* target_frame(const HandEye& result) { return on_hand(result) ? "base" : "flange"; }

std::string found_words(const HandEyeSummary& summary) {
  const HandEye& r = summary.hand_eye;
  const Eigen::Vector3d mm = 1e3 * r.camera.T.translation;
  std::string out = fmt::format(
      "{}, at ({:.2f}, {:.2f}, {:.2f}) mm in the frame of the {}; {} marker{} {}; {} holds the "
      "pose of the {} ({})",
      on_hand(r) ? "The camera is on the hand" : "The camera is fixed", mm.x(), mm.y(), mm.z(),
      camera_frame(r), r.targets.size(), r.targets.size() == 1 ? "" : "s",
      on_hand(r) ? "at rest" : "on the hand", summary.log,
      r.hypothesis.direction == PoseDirection::kBaseFlange ? "flange in the base's frame"
                                                           : "base in the flange's frame",
      r.hypothesis.rotation);
  for (const HandEyeRival& rival : r.rivals) {
    constexpr double kWorthSaying = 0.05;
    if (!rival.same_equation || rival.probability < kWorthSaying) continue;
    out += fmt::format(
        ". The same numbers hold for {} and {} that holds the {} (probability {:.2f}): if that is "
        "so, declare camera_mount: {} in recording.yaml",
        on_hand(r) ? "a fixed camera" : "a camera on the hand", summary.log,
        rival.hypothesis.direction == PoseDirection::kBaseFlange ? "flange in the base's frame"
                                                                 : "base in the flange's frame",
        rival.probability, to_string(rival.hypothesis.mount));
  }
  return out;
}

std::string accurate_words(const HandEye& r) {
  using namespace report;
  const Matrix6d& C = r.camera.covariance;
  const std::string px =
      r.held_out.px > 0.0 ? fmt::format(" ({})", text_with_unit(r.held_out.px, Quantity::kPixels))
                          : "";
  return fmt::format(
      "Markers are predicted to {} and {}{} at {} poses that the fit has not seen ({} and {} at "
      "those it has); the camera's place is known to {}, its rotation to {} (k = 2)",
      text_with_unit(r.held_out.m, Quantity::kLength),
      text_with_unit(r.held_out.rad, Quantity::kAngle), px, r.held_out.frames,
      text_with_unit(r.fitted.m, Quantity::kLength), text_with_unit(r.fitted.rad, Quantity::kAngle),
      text_with_unit(kExpanded * worst_sigma(C.bottomRightCorner<3, 3>()), Quantity::kLength),
      text_with_unit(kExpanded * worst_sigma(C.topLeftCorner<3, 3>()), Quantity::kAngle));
}

std::string limit_words(const HandEyeSummary& summary) {
  using namespace report;
  const HandEye& r = summary.hand_eye;
  std::string out = fmt::format(
      "The controller's poses err by {} and {} an axis (standard deviation), the camera by {:.2g} "
      "of what its sightings declare",
      text_with_unit(r.flange_noise_m, Quantity::kLength),
      text_with_unit(r.flange_noise_rad, Quantity::kAngle), r.camera_noise);
  if (!r.odd_rows.empty())
    out += fmt::format("; {} of {} poses contradict the others and are left out", r.odd_rows.size(),
                       r.frames.size());
  if (r.odd_sightings > 0)
    out += fmt::format(
        "; {} sightings of markers contradict the others of their frame and are "
        "left out",
        r.odd_sightings);
  return out;
}

std::string next_words(const HandEye& r) {
  constexpr int kFew = 15;
  if (r.held_out.frames >= kFew) return "";
  return fmt::format("Record {} poses or more, the hand turned about all axes", kFew);
}

std::string position_words(const Pose& pose) {
  const Eigen::Vector3d mm = 1e3 * pose.translation;
  return fmt::format("({:.2f}, {:.2f}, {:.2f}) mm", mm.x(), mm.y(), mm.z());
}

}  // namespace

Verdict hand_eye_verdict(const HandEyeSummary& summary) {
  return {found_words(summary), accurate_words(summary.hand_eye), limit_words(summary),
          next_words(summary.hand_eye)};
}

std::vector<std::string> odd_row_lines(const HandEyeSummary& summary) {
  using namespace report;
  std::vector<std::string> out;
  for (const OddFlangeRow& row : summary.hand_eye.odd_rows) {
    out.push_back(fmt::format(
        "{}{}: at {} = {:.6g} the hand reads {}, but the markers say {}: {} and {} off, left out",
        summary.log, row.line ? fmt::format(":{}", *row.line) : "", summary.time_column, row.time_s,
        position_words(row.read), position_words(row.expected),
        text_with_unit(row.shift_m, Quantity::kLength),
        text_with_unit(row.turn_rad, Quantity::kAngle)));
  }
  return out;
}

json hand_eye_json(const HandEyeSummary& summary) {
  const HandEye& r = summary.hand_eye;
  const Verdict verdict = hand_eye_verdict(summary);
  json out{{"schema", "kinescope.hand_eye"},
           {"schema_version", 1},
           {"robot", report::text(summary.run.robot)},
           {"recording", report::text(summary.run.recording)},
           {"entry", summary.run.entry},
           {"version", summary.run.version},
           {"inputs", report::inputs_json(summary.run.inputs)},
           {"coverage_factor", kExpanded},
           {"verdict",
            {{"found", report::text(verdict.found)},
             {"accurate", report::text(verdict.accurate)},
             {"limits", report::text(verdict.limits)},
             {"next", report::text(verdict.next)}}},
           {"camera_mount", to_string(r.hypothesis.mount)},
           {"log_direction", to_string(r.hypothesis.direction)},
           {"log_rotation", r.hypothesis.rotation},
           {"camera", uncertain_json(r.camera, camera_frame(r))},
           {"covariance", matrix_json(r.covariance)},
           {"noise",
            {{"camera_over_declared", report::number(r.camera_noise)},
             {"flange_rad", report::number(r.flange_noise_rad)},
             {"flange_m", report::number(r.flange_noise_m)}}},
           {"errors", {{"fitted", error_json(r.fitted)}, {"held_out", error_json(r.held_out)}}},
           {"odd_sightings", r.odd_sightings},
           {"start", r.start},
           {"at_rest", r.postures},
           {"warnings", report::texts(summary.run.warnings)}};
  out["targets"] = list_json(r.targets, [&](const HandEyeTarget& target) {
    json entry = uncertain_json(target.pose, target_frame(r));
    entry["id"] = target.id.value;
    entry["poses"] = target.frames;
    return entry;
  });
  out["rivals"] = list_json(r.rivals, rival_json);
  out["odd_rows"] = list_json(r.odd_rows, odd_row_json);
  out["poses"] = list_json(r.frames, frame_json);
  return out;
}

}  // namespace kinescope
