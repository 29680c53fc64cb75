// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/datasets/dataset_files.h"

namespace kinescope::datasets {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

constexpr std::uintmax_t kLargestInfo = std::uintmax_t{1} << 26U;
constexpr const char* kCopyAgain = "copy the dataset again";

/// info.json's object, asked by key.
class InfoReader {
 public:
  InfoReader(const json& object, std::string place) : object_(object), place_(std::move(place)) {}

  [[nodiscard]] std::string text(const char* key) const {
    const json* value = find(key);
    if (value == nullptr) return {};
    if (!value->is_string()) throw wrong(key, "no text");
    return value->get<std::string>();
  }

  [[nodiscard]] std::optional<double> number(const char* key) const {
    const json* value = find(key);
    if (value == nullptr) return std::nullopt;
    if (!value->is_number()) throw wrong(key, "no number");
    return value->get<double>();
  }

  [[nodiscard]] std::optional<std::size_t> count(const char* key) const {
    const std::optional<double> value = number(key);
    if (!value) return std::nullopt;
    const bool whole = *value >= 0.0 && *value <= static_cast<double>(kMostEpisodes) &&
                       *value == std::floor(*value);
    if (!whole) throw wrong(key, fmt::format("{}, which is no count", *value));
    return static_cast<std::size_t>(*value);
  }

  [[nodiscard]] Error wrong(const std::string& key, const std::string& what) const {
    return bad_input(place_, fmt::format("{} is {}", key, what), kCopyAgain);
  }

 private:
  /// Nothing for what is missing or null.
  [[nodiscard]] const json* find(const char* key) const {
    const auto found = object_.find(key);
    return found == object_.end() || found->is_null() ? nullptr : &*found;
  }

  const json& object_;
  std::string place_;
};

/// Names of elements: a list, or lists by kind ({"motors": [..]}).
void add_element_names(const json& names, std::vector<std::string>& out) {
  if (names.is_string()) out.push_back(names.get<std::string>());
  if (!names.is_array() && !names.is_object()) return;
  for (const json& inner : names) {
    if (inner.is_string()) out.push_back(inner.get<std::string>());
    if (!inner.is_array()) continue;
    for (const json& name : inner)
      if (name.is_string()) out.push_back(name.get<std::string>());
  }
}

bool declares_depth(const json& feature) {
  for (const char* key : {"info", "video_info"}) {
    const auto info = feature.find(key);
    if (info == feature.end() || !info->is_object()) continue;
    for (const char* word : {"is_depth_map", "video.is_depth_map"}) {
      const auto found = info->find(word);
      if (found != info->end() && found->is_boolean() && found->get<bool>()) return true;
    }
  }
  return false;
}

Feature read_feature(const std::string& name, const json& object, const std::string& place) {
  const InfoReader reader(object, fmt::format("{}: feature '{}'", place, name));
  if (!object.is_object()) throw reader.wrong("it", "no description");
  Feature out;
  out.name = name;
  out.dtype = reader.text("dtype");
  out.is_depth = declares_depth(object);
  const auto shape = object.find("shape");
  if (shape != object.end() && shape->is_array()) {
    for (const json& size : *shape) {
      constexpr std::int64_t kLargest = 1 << 20;
      if (!size.is_number_integer() || size.get<std::int64_t>() < 0 ||
          size.get<std::int64_t>() > kLargest) {
        throw reader.wrong("shape", "no list of sizes");
      }
      out.shape.push_back(size.get<std::size_t>());
    }
  }
  const auto names = object.find("names");
  const bool is_row = out.shape.size() == 1;  // of an image the names are those of its axes
  if (names != object.end() && is_row) add_element_names(*names, out.names);
  if (!out.names.empty() && is_row && out.names.size() != out.shape.front()) {
    throw reader.wrong("names", fmt::format("a list of {} for a shape of {}", out.names.size(),
                                            out.shape.front()));
  }
  return out;
}

json parse_info(const fs::path& file) {
  const json out = json::parse(read_text_file(file, kLargestInfo), nullptr, false);
  if (!out.is_object()) throw bad_input(file.string(), "is no JSON object", kCopyAgain);
  return out;
}

std::string checked_version(const InfoReader& reader, const std::string& place) {
  constexpr std::array kKnown = {"v2.0", "v2.1", "v3.0"};
  std::string version = reader.text("codebase_version");
  if (!version.empty() && version.front() != 'v') version.insert(0, 1, 'v');
  if (std::ranges::find(kKnown, version) != kKnown.end()) return version;
  throw bad_input(place,
                  version.empty()
                      ? std::string("has no codebase_version: is this a LeRobot dataset?")
                      : fmt::format("is of LeRobot {}, which is not read", version),
                  "v2.0, v2.1 and v3.0 are: convert it with LeRobot");
}

}  // namespace

fs::path info_file(const fs::path& folder) { return folder / "meta" / "info.json"; }

Info read_info(const fs::path& folder) {
  const fs::path file = info_file(folder);
  const json object = parse_info(file);
  const InfoReader reader(object, file.string());
  Info out;
  out.dataset.folder = folder;
  out.dataset.version = checked_version(reader, file.string());
  out.is_version_3 = out.dataset.version == "v3.0";
  out.dataset.robot_type = reader.text("robot_type");
  out.dataset.frame_rate_hz = reader.number("fps").value_or(0.0);
  constexpr double kFastest = 1e5;
  if (!(out.dataset.frame_rate_hz > 0.0 && out.dataset.frame_rate_hz < kFastest))
    throw reader.wrong("fps", fmt::format("{}, which is no rate", out.dataset.frame_rate_hz));
  out.total_episodes = reader.count("total_episodes");
  out.chunk_size = std::max<std::size_t>(1, reader.count("chunks_size").value_or(out.chunk_size));
  out.data_path = reader.text("data_path");
  out.video_path = reader.text("video_path");
  if (out.data_path.empty()) throw reader.wrong("data_path", "missing");
  const auto features = object.find("features");
  if (features == object.end() || !features->is_object())
    throw reader.wrong("features", "no list of features");
  for (const auto& [name, feature] : features->items())
    out.dataset.features.push_back(read_feature(name, feature, file.string()));
  return out;
}

}  // namespace kinescope::datasets
