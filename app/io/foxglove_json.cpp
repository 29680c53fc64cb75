// SPDX-License-Identifier: Apache-2.0
#include "app/io/foxglove_json.h"

#include <initializer_list>
#include <utility>

namespace kinescope::foxglove {
namespace {

using nlohmann::json;
using Fields = std::initializer_list<std::pair<const char*, json>>;

// ---- JSON Schemas ----

json object_schema(Fields fields) {
  json out{{"type", "object"}, {"properties", json::object()}};
  for (const auto& [name, schema] : fields) out["properties"][name] = schema;
  return out;
}

json list_schema(const json& items) { return {{"type", "array"}, {"items", items}}; }
json number_schema() { return {{"type", "number"}}; }
json text_schema() { return {{"type", "string"}}; }

// "time" and "duration" are how viewers tell them from other objects of two numbers.
json time_schema(const char* title) {
  json out = object_schema({{"sec", {{"type", "integer"}}}, {"nsec", {{"type", "integer"}}}});
  out["title"] = title;
  return out;
}

json vector_schema() {
  return object_schema({{"x", number_schema()}, {"y", number_schema()}, {"z", number_schema()}});
}
json quaternion_schema() {
  return object_schema({{"x", number_schema()},
                        {"y", number_schema()},
                        {"z", number_schema()},
                        {"w", number_schema()}});
}
json pose_schema() {
  return object_schema({{"position", vector_schema()}, {"orientation", quaternion_schema()}});
}
json color_schema() {
  return object_schema({{"r", number_schema()},
                        {"g", number_schema()},
                        {"b", number_schema()},
                        {"a", number_schema()}});
}

json transforms_schema() {
  const json transform = object_schema({{"timestamp", time_schema("time")},
                                        {"parent_frame_id", text_schema()},
                                        {"child_frame_id", text_schema()},
                                        {"translation", vector_schema()},
                                        {"rotation", quaternion_schema()}});
  return object_schema({{"transforms", list_schema(transform)}});
}

json scene_schema() {
  const json cube = object_schema(
      {{"pose", pose_schema()}, {"size", vector_schema()}, {"color", color_schema()}});
  const json text = object_schema({{"pose", pose_schema()},
                                   {"billboard", {{"type", "boolean"}}},
                                   {"font_size", number_schema()},
                                   {"scale_invariant", {{"type", "boolean"}}},
                                   {"color", color_schema()},
                                   {"text", text_schema()}});
  const json none = list_schema({{"type", "object"}});
  const json entity = object_schema({{"timestamp", time_schema("time")},
                                     {"frame_id", text_schema()},
                                     {"id", text_schema()},
                                     {"lifetime", time_schema("duration")},
                                     {"frame_locked", {{"type", "boolean"}}},
                                     {"metadata", none},
                                     {"arrows", none},
                                     {"cubes", list_schema(cube)},
                                     {"spheres", none},
                                     {"cylinders", none},
                                     {"lines", none},
                                     {"triangles", none},
                                     {"texts", list_schema(text)},
                                     {"models", none}});
  return object_schema({{"deletions", none}, {"entities", list_schema(entity)}});
}

json camera_schema() {
  const json numbers = list_schema(number_schema());
  return object_schema({{"timestamp", time_schema("time")},
                        {"frame_id", text_schema()},
                        {"width", {{"type", "integer"}}},
                        {"height", {{"type", "integer"}}},
                        {"distortion_model", text_schema()},
                        {"D", numbers},
                        {"K", numbers},
                        {"R", numbers},
                        {"P", numbers}});
}

json log_schema() {
  return object_schema({{"timestamp", time_schema("time")},
                        {"level", {{"type", "integer"}}},
                        {"message", text_schema()},
                        {"name", text_schema()},
                        {"file", text_schema()},
                        {"line", {{"type", "integer"}}}});
}

bags::McapChannel json_channel(const std::string& topic, const std::string& name, json schema) {
  schema["title"] = name;
  schema["$schema"] = "https://json-schema.org/draft/2020-12/schema";
  return {topic, name, "jsonschema", schema.dump(), "json"};
}

// ---- messages ----

json vector_json(const Eigen::Vector3d& v) { return {{"x", v.x()}, {"y", v.y()}, {"z", v.z()}}; }
json quaternion_json(const Eigen::Quaterniond& q) {
  return {{"x", q.x()}, {"y", q.y()}, {"z", q.z()}, {"w", q.w()}};
}
json placed_json(const Pose& pose) {
  return {{"position", vector_json(pose.translation)},
          {"orientation", quaternion_json(pose.rotation)}};
}
json color_json(double r, double g, double b, double a) {
  return {{"r", r}, {"g", g}, {"b", b}, {"a", a}};
}

json plate_entity(std::uint64_t time_ns, const Plate& plate) {
  constexpr double kThickness = 0.02;  // of the edge
  const json none = json::array();
  const json cube{{"pose", placed_json(plate.T_frame_plate)},
                  {"size", vector_json({plate.edge_m, plate.edge_m, kThickness * plate.edge_m})},
                  {"color", color_json(0.1, 0.4, 0.8, 0.8)}};
  const json text{{"pose", placed_json(plate.T_frame_plate)}, {"billboard", true},
                  {"font_size", 0.5 * plate.edge_m},          {"scale_invariant", false},
                  {"color", color_json(0.0, 0.0, 0.0, 1.0)},  {"text", plate.name}};
  return {{"timestamp", timestamp(time_ns)},
          {"frame_id", plate.frame},
          {"id", plate.name},
          {"lifetime", timestamp(0)},
          {"frame_locked", true},
          {"metadata", none},
          {"arrows", none},
          {"cubes", json::array({cube})},
          {"spheres", none},
          {"cylinders", none},
          {"lines", none},
          {"triangles", none},
          {"texts", json::array({text})},
          {"models", none}};
}

}  // namespace

bags::McapChannel frame_transforms_channel(const std::string& topic) {
  return json_channel(topic, "foxglove.FrameTransforms", transforms_schema());
}
bags::McapChannel scene_channel(const std::string& topic) {
  return json_channel(topic, "foxglove.SceneUpdate", scene_schema());
}
bags::McapChannel camera_calibration_channel(const std::string& topic) {
  return json_channel(topic, "foxglove.CameraCalibration", camera_schema());
}
bags::McapChannel log_channel(const std::string& topic) {
  return json_channel(topic, "foxglove.Log", log_schema());
}

bags::McapChannel numbers_channel(const std::string& topic, const std::string& schema,
                                  const std::vector<std::string>& groups) {
  json out = object_schema({{"timestamp", time_schema("time")}});
  for (const std::string& group : groups) {
    out["properties"][group] = {{"type", "object"}, {"additionalProperties", {{"type", "number"}}}};
  }
  return json_channel(topic, schema, std::move(out));
}

json timestamp(std::uint64_t time_ns) {
  constexpr std::uint64_t kSecond = 1'000'000'000;
  return {{"sec", time_ns / kSecond}, {"nsec", time_ns % kSecond}};
}

json frame_transforms(std::uint64_t time_ns, const std::vector<FrameTransform>& transforms) {
  json out{{"transforms", json::array()}};
  for (const FrameTransform& one : transforms) {
    out["transforms"].push_back({{"timestamp", timestamp(time_ns)},
                                 {"parent_frame_id", one.parent},
                                 {"child_frame_id", one.child},
                                 {"translation", vector_json(one.T_parent_child.translation)},
                                 {"rotation", quaternion_json(one.T_parent_child.rotation)}});
  }
  return out;
}

json plates(std::uint64_t time_ns, const std::vector<Plate>& plates) {
  json out{{"deletions", json::array()}, {"entities", json::array()}};
  for (const Plate& plate : plates) out["entities"].push_back(plate_entity(time_ns, plate));
  return out;
}

json log_message(std::uint64_t time_ns, const std::string& text) {
  constexpr int kInfo = 2;
  return {{"timestamp", timestamp(time_ns)},
          {"level", kInfo},
          {"message", text},
          {"name", "kinescope"},
          {"file", ""},
          {"line", 0}};
}

}  // namespace kinescope::foxglove
