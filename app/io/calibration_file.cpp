// SPDX-License-Identifier: Apache-2.0
#include "app/io/calibration_file.h"

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "calib/camera/camera_model.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

using nlohmann::json;

// What the file says is checked where it is read; the reader's caller names the file.
struct Unreadable {
  std::string what;
};

[[noreturn]] void refuse(const std::string& what) { throw Unreadable{what}; }

double stored_number(const json& value, std::string_view name) {
  const double out = value.is_number() ? value.get<double>() : std::nan("");
  if (!std::isfinite(out)) refuse(fmt::format("{} is no number", name));
  return out;
}

Sigma stored_sigma(const json& value, std::string_view name) {
  if (value.is_null()) return std::nullopt;
  const double out = stored_number(value, name);
  if (out < 0.0) refuse(fmt::format("{} is below 0", name));
  return out;
}

Eigen::Vector3d stored_vector(const json& value, std::string_view name) {
  if (!value.is_array() || value.size() != 3) refuse(fmt::format("{} is no vector", name));
  return {stored_number(value[0], name), stored_number(value[1], name),
          stored_number(value[2], name)};
}

Pose stored_pose(const json& value, std::string_view name) {
  constexpr double kUnitLength = 1e-6;  // digits of the file
  const json& q = value.at("quaternion_xyzw");
  if (!q.is_array() || q.size() != 4) refuse(fmt::format("{} has no quaternion", name));
  std::array<double, 4> n{};
  for (std::size_t i = 0; i < 4; ++i) n[i] = stored_number(q[i], name);
  Pose out{Eigen::Quaterniond(n[3], n[0], n[1], n[2]),
           stored_vector(value.at("translation_m"), name)};
  if (std::abs(out.rotation.norm() - 1.0) > kUnitLength)
    refuse(fmt::format("{}: the quaternion's length is not 1", name));
  out.rotation.normalize();
  return out;
}

JointType stored_type(const std::string& word) {
  for (const JointType type : {JointType::kFixed, JointType::kRevolute, JointType::kPrismatic})
    if (word == to_string(type)) return type;
  refuse(fmt::format("'{}' is no type of joint", word));
}

LinkId stored_link(const KinematicTree& tree, const json& name) {
  const auto link = tree.link(name.get<std::string>());
  if (!link) refuse(fmt::format("no link is named '{}'", name.get<std::string>()));
  return *link;
}

Joint stored_joint(const json& entry, const KinematicTree& tree) {
  Joint out;
  out.name = entry.at("name").get<std::string>();
  out.type = stored_type(entry.at("type").get<std::string>());
  out.parent = stored_link(tree, entry.at("parent"));
  out.child = stored_link(tree, entry.at("child"));
  out.T_parent_joint = stored_pose(entry.at("T_parent_joint"), out.name);
  out.axis = stored_vector(entry.at("axis"), out.name + " axis");
  out.channel = entry.at("channel").get<std::string>();
  out.scale = stored_number(entry.at("scale"), out.name + " scale");
  out.offset = stored_number(entry.at("offset"), out.name + " offset");
  if (out.scale == 0.0) refuse(out.name + " scale is 0");
  for (const json& share : entry.value("couplings", json::array())) {
    out.couplings.push_back({share.at("channel").get<std::string>(),
                             stored_number(share.at("ratio"), out.name + " ratio")});
  }
  for (const json& copy : entry.value("copies", json::array()))
    out.copies.push_back(copy.get<std::string>());
  return out;
}

// Not a number where the file has none.
JointLimits stored_range(const json& entry, const std::string& name) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  const auto range = entry.find("range");
  if (range == entry.end()) return {kUnknown, kUnknown};
  if (!range->is_array() || range->size() != 2) refuse(name + " range is no pair of numbers");
  if ((*range)[0].is_null() || (*range)[1].is_null()) return {kUnknown, kUnknown};
  const JointLimits out{stored_number((*range)[0], name + " range"),
                        stored_number((*range)[1], name + " range")};
  if (!(out.lower <= out.upper)) refuse(name + " range ends below where it begins");
  return out;
}

void take_robot(const json& robot, Calibration& out) {
  out.tree.name = robot.at("name").get<std::string>();
  for (const json& link : robot.at("links")) out.tree.links.push_back({link.get<std::string>()});
  for (const json& entry : robot.at("joints")) {
    Joint joint = stored_joint(entry, out.tree);
    JointEstimate estimate;
    estimate.range = stored_range(entry, joint.name);
    if (!entry.contains("parameters_at"))
      refuse(joint.name + " has no 'parameters_at': an earlier version wrote this");
    estimate.parameters_at =
        stored_number(entry.at("parameters_at"), joint.name + " parameters_at");
    if (std::isfinite(estimate.range.lower)) joint.limits = estimate.range;
    out.tree.joints.push_back(std::move(joint));
    out.joints.push_back(estimate);
  }
  for (const json& entry : robot.at("markers")) {
    const TagId id{entry.at("id").get<int>()};
    const std::string name = fmt::format("tag_{}", id.value);
    out.tree.markers.push_back({id, stored_link(out.tree, entry.at("link")),
                                stored_pose(entry.at("T_link_marker"), name),
                                stored_number(entry.at("size_m"), name + " size_m")});
  }
  try {
    check_tree(out.tree);
  } catch (const std::logic_error& error) {
    refuse(fmt::format("the robot is none: {}", error.what()));
  }
}

void take_camera(const json& camera, Calibration& out) {
  CameraModel& model = out.camera;
  model.width = camera.at("width").get<int>();
  model.height = camera.at("height").get<int>();
  model.fx = stored_number(camera.at("fx"), "fx");
  model.fy = stored_number(camera.at("fy"), "fy");
  model.cx = stored_number(camera.at("cx"), "cx");
  model.cy = stored_number(camera.at("cy"), "cy");
  const auto word = camera.at("distortion_model").get<std::string>();
  bool known = false;
  for (const auto distortion : {DistortionModel::kPlumbBob, DistortionModel::kRationalPolynomial,
                                DistortionModel::kEquidistant}) {
    if (word != to_string(distortion)) continue;
    model.model = distortion;
    known = true;
  }
  if (!known) refuse(fmt::format("'{}' is no distortion model", word));
  const json& terms = camera.at("distortion");
  if (std::ssize(terms) != distortion_count(model.model)) refuse("distortion has other terms");
  for (std::size_t i = 0; i < terms.size(); ++i)
    model.distortion[i] = stored_number(terms[i], "distortion");
  out.intrinsics_estimated = camera.at("estimated").get<bool>();
}

void take_parameters(const json& document, Calibration& out) {
  for (const json& entry : document.at("parameters")) {
    Parameter p;
    p.name = entry.at("name").get<std::string>();
    p.block = entry.at("block").get<std::string>();
    p.unit = entry.at("unit").get<std::string>();
    p.value = entry.at("value").is_null() ? 0.0 : stored_number(entry.at("value"), p.name);
    p.sigma = stored_sigma(entry.at("sigma"), p.name + " sigma");
    p.sigma_white = stored_sigma(entry.at("sigma_white"), p.name + " sigma_white");
    out.parameters.push_back(std::move(p));
  }
  const json& rows = document.at("covariance");
  const auto n = std::ssize(out.parameters);
  if (!rows.is_array() || std::ssize(rows) != n)
    refuse(fmt::format("the covariance has not {} rows, one a parameter", n));
  out.covariance.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const json& row = rows[static_cast<std::size_t>(i)];
    if (!row.is_array() || std::ssize(row) != n) refuse("the covariance is not square");
    for (Eigen::Index k = 0; k < n; ++k)
      out.covariance(i, k) = stored_number(row[static_cast<std::size_t>(k)], "the covariance");
  }
}

// The path of one that is carried stands in a table of its own.
void take_motion(const json& motion, Calibration& out) {
  out.moving = MovingCamera{};
  if (motion.at("camera_mount") == "carried") return;
  const std::string name = motion.at("link").get<std::string>();
  const auto link = out.tree.link(name);
  if (!link || link->value == 0) refuse(fmt::format("the camera's link '{}' is none of it", name));
  out.moving->link = *link;
  out.moving->T_camera_link = stored_pose(motion.at("T_camera_link"), "T_camera_link");
}

CalibrationStatus stored_status(const std::string& word) {
  for (const auto status : {CalibrationStatus::kConverged, CalibrationStatus::kNotConverged,
                            CalibrationStatus::kUndetermined})
    if (word == to_string(status)) return status;
  refuse(fmt::format("'{}' is no status", word));
}

double error_or_unknown(const json& value) {
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

Calibration calibration_of(const json& document) {
  if (!document.is_object() || document.value("schema", json()) != "kinescope.calibration")
    refuse("this is no calibration");
  const json version = document.value("schema_version", json());
  if (version != 1) {
    refuse(fmt::format("this program reads version 1 of calibrations, not {}",
                       version.is_null() ? "none" : version.dump()));
  }
  Calibration out;
  out.status = stored_status(document.at("status").get<std::string>());
  out.status_reason = document.at("status_reason").get<std::string>();
  out.kind = document.at("rms_unit") == "px" ? MeasurementKind::kCorners : MeasurementKind::kPose;
  take_robot(document.at("robot"), out);
  out.T_camera_base = stored_pose(document.at("T_camera_base"), "T_camera_base");
  if (document.contains("camera_motion")) take_motion(document.at("camera_motion"), out);
  take_camera(document.at("camera"), out);
  out.camera_name = document.value("camera_name", "");
  out.time_offset_s = stored_number(document.at("time_offset_s"), "time_offset_s");
  out.time_offset_sigma_s = stored_sigma(document.at("time_offset_sigma_s"), "time_offset_sigma_s");
  out.gauge = document.at("gauge").get<std::string>();
  if (document.contains("noise_widening"))
    out.noise_widening = stored_sigma(document.at("noise_widening"), "noise_widening");
  out.training_rms = error_or_unknown(document.at("training_rms"));
  out.held_out_rms = error_or_unknown(document.at("held_out_rms"));
  out.before_rms = error_or_unknown(document.at("before_rms"));
  out.final_rms = error_or_unknown(document.at("final_rms"));
  take_parameters(document, out);
  return out;
}

}  // namespace

Calibration parse_calibration(std::string_view text, const std::string& source) {
  std::string what;
  try {
    const json document = json::parse(text, nullptr, false);
    if (document.is_discarded()) refuse("it is no JSON, or ends early");
    return calibration_of(document);
  } catch (const Unreadable& unreadable) {
    what = unreadable.what;
  } catch (const json::exception& error) {
    // "[json.exception.out_of_range.403] key 'robot' not found": the words behind the code.
    const std::string words = error.what();
    what = words.substr(std::min(words.size(), words.find("] ") + 2));
  }
  throw bad_input(source, what, "give the folder of a finished run, or run the recording again");
}

Calibration read_calibration(const std::filesystem::path& calibration_json) {
  return parse_calibration(read_text_file(calibration_json), calibration_json.string());
}

}  // namespace kinescope
