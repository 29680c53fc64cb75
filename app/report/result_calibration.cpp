// SPDX-License-Identifier: Apache-2.0
//
// The calibrated parameters and what the data say of them, for the result document.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "app/report/facts.h"
#include "app/report/html.h"
#include "app/report/result_values.h"
#include "kinematics/core/text.h"

namespace kinescope::report {

using nlohmann::json;

json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json expanded(const Sigma& sigma) {
  return sigma ? number(kCoverageFactor * *sigma) : json(nullptr);
}

json standard(const Sigma& sigma) { return sigma ? number(*sigma) : json(nullptr); }

json text(std::string_view value) { return clean_text(value); }

json numbers(const Eigen::VectorXd& values) {
  json out = json::array();
  for (const double value : values) out.push_back(number(value));
  return out;
}

json inputs_json(const std::vector<InputFile>& inputs) {
  json out = json::array();
  for (const InputFile& input : inputs) {
    out.push_back({{"name", text(input.name)}, {"sha256", text(input.sha256)}});
  }
  return out;
}

json texts(const std::vector<std::string>& values) {
  json list = json::array();
  for (const std::string& value : values) list.push_back(text(value));
  return list;
}

json vector3(const Eigen::Vector3d& v) { return {number(v.x()), number(v.y()), number(v.z())}; }

json pose(const Pose& T) {
  const Eigen::Quaterniond& q = T.rotation;
  const Eigen::Matrix3d R = T.matrix3();
  // Fixed-axis roll, pitch, yaw as in URDF: R = Rz(yaw) Ry(pitch) Rx(roll).
  const double pitch = std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0)));
  const bool locked = std::hypot(R(0, 0), R(1, 0)) < 1e-9;
  const double roll = locked ? std::atan2(-R(1, 2), R(1, 1)) : std::atan2(R(2, 1), R(2, 2));
  const double yaw = locked ? 0.0 : std::atan2(R(1, 0), R(0, 0));
  return {{"translation_m", vector3(T.translation)},
          {"quaternion_wxyz", {number(q.w()), number(q.x()), number(q.y()), number(q.z())}},
          {"rpy_rad", {number(roll), number(pitch), number(yaw)}}};
}

namespace {

json joint_json(const RunSummary& run, std::size_t index) {
  const Calibration& calibration = run.calibration;
  const Joint& joint = calibration.tree.joints[index];
  json document = {{"name", text(joint.name)},
                   {"type", kinescope::to_string(joint.type)},
                   {"parent", text(calibration.tree.links.at(joint.parent.index()).name)},
                   {"child", text(calibration.tree.links.at(joint.child.index()).name)},
                   {"channel", joint.channel.empty() ? json(nullptr) : text(joint.channel)},
                   {"unit", joint.type == JointType::kPrismatic ? "m" : "rad"},
                   {"scale", number(joint.scale)},
                   {"offset", number(joint.offset)},
                   {"origin", pose(joint.T_parent_joint)}};
  for (const ChannelShare& share : joint.couplings) {
    document["couplings"].push_back(
        {{"channel", text(share.channel)}, {"ratio", number(share.ratio)}});
  }
  if (index >= calibration.joints.size()) return document;
  const JointEstimate& estimate = calibration.joints[index];
  document["axis_base"] = vector3(estimate.axis_base);
  document["point_base_m"] = vector3(estimate.point_base);
  document["direction_expanded_rad"] = expanded(estimate.direction_sigma_rad);
  document["position_expanded_m"] = expanded(estimate.position_sigma_m);
  document["among_direction_expanded_rad"] = expanded(estimate.among_direction_sigma_rad);
  document["among_position_expanded_m"] = expanded(estimate.among_position_sigma_m);
  document["offset_expanded"] = expanded(estimate.offset_sigma);
  document["scale_expanded"] = expanded(estimate.scale_sigma);
  document["range"] = {number(estimate.range.lower), number(estimate.range.upper)};
  document["travel"] = number(estimate.range.upper - estimate.range.lower);
  return document;
}

/// What the calibration changed of a nominal robot's joint.
json change_json(const Joint& nominal, const Joint& found) {
  const Pose change = nominal.T_parent_joint.inverse() * found.T_parent_joint;
  return {{"shift_m", number(change.translation.norm())},
          {"turn_rad", number(log_rotation(change.rotation).norm())},
          {"offset", number(found.offset - nominal.offset)}};
}

json joints_json(const RunSummary& run) {
  json list = json::array();
  for (std::size_t j = 0; j < run.calibration.tree.joints.size(); ++j) {
    json joint = joint_json(run, j);
    joint["change_against_nominal"] = nullptr;
    if (run.nominal) {
      if (const auto id = run.nominal->joint(run.calibration.tree.joints[j].name)) {
        joint["change_against_nominal"] =
            change_json(run.nominal->joints[id->index()], run.calibration.tree.joints[j]);
      }
    }
    list.push_back(std::move(joint));
  }
  return list;
}

json marker_json(const Calibration& calibration, std::size_t index) {
  const Marker& marker = calibration.tree.markers[index];
  json document = {{"id", marker.id.value},
                   {"link", text(marker_link(calibration.tree, marker.id))},
                   {"size_m", number(marker.size_m)},
                   {"mount", pose(marker.T_link_marker)}};
  if (index >= calibration.markers.size()) return document;
  const MarkerEstimate& estimate = calibration.markers[index];
  document["rotation_expanded_rad"] = expanded(estimate.rotation_sigma_rad);
  document["translation_expanded_m"] = expanded(estimate.translation_sigma_m);
  document["used"] = estimate.used;
  document["rejected"] = estimate.rejected;
  return document;
}

std::vector<std::string> intrinsic_names(const CameraModel& camera) {
  std::vector<std::string> names = {"fx", "fy", "cx", "cy"};
  const bool fisheye = camera.model == DistortionModel::kEquidistant;
  const std::vector<std::string> terms =
      fisheye ? std::vector<std::string>{"k1", "k2", "k3", "k4"}
              : std::vector<std::string>{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  const auto count = static_cast<std::size_t>(distortion_count(camera.model));
  names.insert(names.end(), terms.begin(), terms.begin() + static_cast<long>(count));
  return names;
}

/// Largest expanded uncertainty of the parameters of a block in one unit.
json worst_of_block(const Calibration& calibration, std::string_view block, std::string_view unit) {
  json worst = nullptr;
  for (const Parameter& parameter : calibration.parameters) {
    if (parameter.block != block || parameter.unit != unit || !parameter.sigma) continue;
    const double one = kCoverageFactor * *parameter.sigma;
    if (worst.is_null() || one > worst.get<double>()) worst = number(one);
  }
  return worst;
}

json camera_json(const Calibration& calibration) {
  json document = {{"pose_in_base", pose(calibration.T_camera_base.inverse())},
                   {"rotation_expanded_rad", worst_of_block(calibration, "camera", "rad")},
                   {"translation_expanded_m", worst_of_block(calibration, "camera", "m")},
                   {"intrinsics", nullptr}};
  if (calibration.moving && calibration.moving->on_robot()) {
    document["link"] = text(calibration.tree.links[calibration.moving->link.index()].name);
    document["pose_on_link"] = pose(calibration.moving->T_camera_link.inverse());
  }
  if (calibration.kind != MeasurementKind::kCorners) return document;
  const CameraModel& camera = calibration.camera;
  json intrinsics = json::array();
  const std::vector<std::string> names = intrinsic_names(camera);
  const std::array<double, 4> pinhole = {camera.fx, camera.fy, camera.cx, camera.cy};
  for (std::size_t k = 0; k < names.size(); ++k) {
    intrinsics.push_back({{"name", names[k]},
                          {"unit", k < 4 ? "px" : ""},
                          {"value", number(k < 4 ? pinhole[k] : camera.distortion[k - 4])},
                          {"expanded", expanded(calibration.intrinsics_sigma[k])}});
  }
  document["intrinsics"] = {{"model", kinescope::to_string(camera.model)},
                            {"width", camera.width},
                            {"height", camera.height},
                            {"estimated", calibration.intrinsics_estimated},
                            {"values", intrinsics}};
  return document;
}

/// Of several cameras, the reference camera first; null of one.
json cameras_json(const Calibration& calibration) {
  if (calibration.cameras() < 2) return nullptr;
  const std::vector<CameraErrors> errors = errors_of_cameras(calibration);
  const std::string unit = calibration.kind == MeasurementKind::kCorners ? "px" : "m";
  json list = json::array();
  for (std::size_t c = 0; c < calibration.cameras(); ++c) {
    const CameraEstimate* further = c == 0 ? nullptr : &calibration.further_cameras[c - 1];
    list.push_back(
        {{"name", text(calibration.name_of_camera(c))},
         {"pose_in_base", pose(calibration.T_camera_base_of(c).inverse())},
         {"rotation_expanded_rad", further ? expanded(further->rotation_sigma_rad)
                                           : worst_of_block(calibration, "camera", "rad")},
         {"translation_expanded_m", further ? expanded(further->translation_sigma_m)
                                            : worst_of_block(calibration, "camera", "m")},
         {"lag_s", number(further ? further->lag_s : 0.0)},
         {"lag_expanded_s", further ? expanded(further->lag_sigma_s) : json(nullptr)},
         {"sightings_used", errors[c].used},
         {"sightings_rejected", errors[c].rejected},
         {"final_" + unit, number(errors[c].final_rms)},
         {"held_out_" + unit, number(errors[c].held_out_rms)}});
  }
  return list;
}

json parameters_json(const Calibration& calibration) {
  json list = json::array();
  for (const Parameter& parameter : calibration.parameters) {
    list.push_back({{"name", text(parameter.name)},
                    {"block", text(parameter.block)},
                    {"unit", text(parameter.unit)},
                    {"value", number(parameter.value)},
                    {"sigma", standard(parameter.sigma)},
                    {"sigma_white", standard(parameter.sigma_white)},
                    {"expanded", expanded(parameter.sigma)}});
  }
  return list;
}

}  // namespace

json calibration_json(const RunSummary& run) {
  const Calibration& calibration = run.calibration;
  json markers = json::array();
  int used = 0, left_out = 0;
  for (std::size_t m = 0; m < calibration.tree.markers.size(); ++m) {
    markers.push_back(marker_json(calibration, m));
  }
  for (const SightingResidual& sighting : calibration.residuals) {
    (sighting.used ? used : left_out) += 1;
  }
  const double ratio = held_out_ratio(calibration);
  json out = {{"status", status_words(calibration.status)},
              {"reason", text(calibration.status_reason)},
              {"gauge", text(calibration.gauge)},
              {"joints", joints_json(run)},
              {"markers", markers},
              {"camera", camera_json(calibration)},
              {"time_offset_s", number(calibration.time_offset_s)},
              {"time_offset_expanded_s", expanded(calibration.time_offset_sigma_s)},
              {"parameters", parameters_json(calibration)},
              {"sightings_used", used},
              {"sightings_rejected", left_out},
              {"sigma_scale", number(calibration.sigma_scale)},
              {"before_rms", number(calibration.before_rms)},
              {"training_rms", number(calibration.training_rms)},
              {"held_out_rms", number(calibration.held_out_rms)},
              {"final_rms", number(calibration.final_rms)},
              {"held_out_over_training", ratio > 0.0 ? number(ratio) : json(nullptr)},
              {"before_rotation_rms_rad", number(calibration.before_rotation_rms_rad)},
              {"training_rotation_rms_rad", number(calibration.training_rotation_rms_rad)},
              {"held_out_rotation_rms_rad", number(calibration.held_out_rotation_rms_rad)},
              {"folds", calibration.folds},
              {"correlation_time_s", number(calibration.correlation_time_s)},
              {"iterations", calibration.iterations},
              {"initial_cost", number(calibration.initial_cost)},
              {"final_cost", number(calibration.final_cost)},
              {"warnings", texts(calibration.warnings)}};
  if (json cameras = cameras_json(calibration); !cameras.is_null())
    out["cameras"] = std::move(cameras);
  return out;
}

namespace {

json strong_correlations(const Calibration& calibration) {
  struct Pair {
    double size;
    std::size_t a, b;
  };
  std::vector<Pair> pairs;
  for (std::size_t a = 0; a < calibration.parameters.size(); ++a) {
    for (std::size_t b = a + 1; b < calibration.parameters.size(); ++b) {
      const double size = std::abs(correlation(calibration, a, b));
      if (size >= kStrongCorrelation) pairs.push_back({size, a, b});
    }
  }
  std::ranges::stable_sort(pairs, std::greater{}, &Pair::size);
  constexpr std::size_t kMostPairs = 20;
  if (pairs.size() > kMostPairs) pairs.resize(kMostPairs);
  json list = json::array();
  for (const Pair& pair : pairs) {
    list.push_back({{"a", text(calibration.parameters[pair.a].name)},
                    {"b", text(calibration.parameters[pair.b].name)},
                    {"correlation", number(correlation(calibration, pair.a, pair.b))}});
  }
  return list;
}

}  // namespace

json observability_json(const Calibration& calibration) {
  json values = json::array(), weak = json::array();
  for (const double value : calibration.observability.singular_values) {
    values.push_back(number(value));
  }
  for (const WeakDirection& direction : calibration.observability.weak) {
    json weights = json::array();
    for (const auto& [index, weight] : direction.parameters) {
      const auto place = static_cast<std::size_t>(index);
      const bool known = index >= 0 && place < calibration.parameters.size();
      weights.push_back(
          {{"parameter", known ? text(calibration.parameters[place].name) : json(nullptr)},
           {"weight", number(weight)}});
    }
    weak.push_back({{"relative_singular_value", number(direction.relative_singular_value)},
                    {"words", text(direction.words)},
                    {"parameters", weights}});
  }
  return {{"condition_number", number(calibration.observability.condition_number)},
          {"singular_values", values},
          {"weak", weak},
          {"strong_correlations", strong_correlations(calibration)}};
}

}  // namespace kinescope::report
