// SPDX-License-Identifier: Apache-2.0
//
// recording.yaml: what cannot be seen in the other files.
#include <algorithm>

#include <fmt/format.h>

#include "app/io/flange_convention.h"
#include "app/io/nearest_name.h"
#include "app/io/recording.h"
#include "app/io/yaml_value.h"

namespace kinescope {
namespace {

constexpr int kMostRowOffset = 1'000'000;

Eigen::Vector3d read_direction(const YamlValue& value) {
  const std::vector<YamlValue> items = value.items();
  if (items.size() != 3) {
    throw value.error(fmt::format("has {} numbers, not 3", items.size()),
                      "write [x, y, z] in the camera's frame");
  }
  const Eigen::Vector3d v(items[0].number(), items[1].number(), items[2].number());
  if (v.norm() < 1e-9) throw value.error("has no length", "write a direction such as [0, 1, 0]");
  return v;
}

TargetDistance read_target_distance(const YamlValue& value) {
  value.only_keys({"from", "to", "distance", "sigma"});
  TargetDistance out{.from = value.require("from").text(), .to = value.require("to").text()};
  out.distance_m = value.require("distance").positive("give the distance in m");
  if (const auto sigma = value.find("sigma")) out.sigma_m = sigma->positive("give it in m");
  if (out.from == out.to) throw value.error("joins a target to itself", "name two targets");
  return out;
}

std::string read_unit(const YamlValue& value) {
  static const std::vector<std::string> kUnits = {"rad", "deg", "m", "mm", "ticks"};
  const std::string unit = value.text();
  if (std::ranges::find(kUnits, unit) != kUnits.end()) return unit;
  throw value.error(fmt::format("is '{}', a unit nobody knows", unit), did_you_mean(unit, kUnits));
}

CameraMount read_mount(const YamlValue& value) {
  for (const CameraMount mount : {CameraMount::kOnHand, CameraMount::kFixed, CameraMount::kCarried})
    if (value.text() == to_string(mount)) return mount;
  throw value.error(fmt::format("is '{}'", value.text()), "write hand, fixed or carried");
}

std::string read_rotation(const YamlValue& value) {
  const std::vector<std::string> known = rotation_convention_names();
  const std::string name = value.text();
  if (std::ranges::find(known, name) != known.end()) return name;
  throw value.error(fmt::format("is '{}', a convention nobody knows", name),
                    did_you_mean(name, known));
}

FlangeDeclaration read_flange_declaration(const YamlValue& value) {
  value.only_keys({"rotation", "conjugate", "unit", "row_offset"});
  FlangeDeclaration out;
  if (const auto rotation = value.find("rotation")) out.rotation = read_rotation(*rotation);
  if (const auto conjugate = value.find("conjugate")) out.conjugate = conjugate->flag();
  if (const auto unit = value.find("unit")) {
    if (unit->text() != "rad" && unit->text() != "deg")
      throw unit->error(fmt::format("is '{}'", unit->text()), "write rad or deg");
    out.degrees = unit->text() == "deg";
  }
  if (const auto offset = value.find("row_offset")) out.row_offset = offset->whole(-kMostRowOffset);
  return out;
}

}  // namespace

RecordingSettings read_recording_settings(const std::filesystem::path& path) {
  const YamlValue file = YamlValue::read(path);
  file.only_keys({"name", "torques", "gravity", "fixed_tags", "video_start", "target_distances",
                  "units", "camera_mount", "gravity_camera", "dynamics", "flange"});
  RecordingSettings settings;
  if (const auto name = file.find("name")) settings.name = name->text();
  if (const auto list = file.find("torques")) {
    for (const YamlValue& item : list->items()) settings.torque_channels.push_back(item.text());
  }
  if (const auto gravity = file.find("gravity")) settings.gravity = read_direction(*gravity);
  if (const auto list = file.find("fixed_tags")) {
    for (const YamlValue& item : list->items()) settings.fixed_tags.push_back({item.whole(0)});
  }
  if (const auto start = file.find("video_start")) {
    if (start->is_mapping()) {
      for (const auto& [camera, value] : start->entries())
        settings.video_starts_s[camera] = value.number();
    } else {
      settings.video_start_s = start->number();
    }
  }
  if (const auto name = file.find("gravity_camera")) settings.gravity_camera = name->text();
  if (const auto list = file.find("target_distances")) {
    for (const YamlValue& item : list->items()) {
      settings.target_distances.push_back(read_target_distance(item));
    }
  }
  if (const auto units = file.find("units")) {
    for (const auto& [channel, unit] : units->entries()) settings.units[channel] = read_unit(unit);
  }
  if (const auto mount = file.find("camera_mount")) settings.camera_mount = read_mount(*mount);
  if (const auto flange = file.find("flange")) settings.flange = read_flange_declaration(*flange);
  return settings;
}

}  // namespace kinescope
