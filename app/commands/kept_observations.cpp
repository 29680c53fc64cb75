// SPDX-License-Identifier: Apache-2.0
#include "app/commands/kept_observations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/io/json_text.h"
#include "app/io/output_folder.h"
#include "app/io/products.h"
#include "app/io/sha256.h"
#include "kinematics/bags/bag.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/file.h"
#include "kinematics/datasets/dataset.h"
#include "kinematics/recorded/container.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::size_t kColumns = 8;  // of observations_csv()

// What one camera saw: "observations.csv", "observations_left.csv".
std::string observations_file(const std::string& camera, std::string_view ending) {
  return camera.empty() ? fmt::format("observations.{}", ending)
                        : fmt::format("observations_{}.{}", camera, ending);
}

// Of a file, or of the list of a folder's files with their hashes (as `sha256sum * | sha256sum`);
// of a bag with its topic, of a dataset with its camera and episodes.
std::string sha256_of_path(const fs::path& path) {
  if (datasets::dataset_source(path)) {
    std::string list = recorded::short_name(path) + "\n";
    for (const fs::path& part : recorded::parts_of(path))
      list += fmt::format("{}  {}\n", sha256_of_file(part), part.filename().string());
    return sha256_of_text(list);
  }
  if (const auto bag = bags::bag_source(path); bag && !bag->topic.empty())
    return sha256_of_text(sha256_of_path(bag->bag) + bag->topic);
  if (!fs::is_directory(path)) return sha256_of_file(path);
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(path)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  std::string list;
  for (const fs::path& file : files) {
    list += fmt::format("{}  {}\n", sha256_of_file(file), file.filename().string());
  }
  return sha256_of_text(list);
}

// The numbers of a row as observations_csv() writes it; false for any other.
bool read_row(std::string_view line, std::array<double, kColumns>& row) {
  for (double& value : row) {
    const std::size_t end = std::min(line.find(','), line.size());
    const std::optional<double> number = parse_number(line.substr(0, end));
    if (!number) return false;
    value = *number;
    line.remove_prefix(std::min(end + 1, line.size()));
  }
  return line.empty();
}

bool is_whole(double value) {
  return value >= 0.0 && value <= std::numeric_limits<int>::max() && value == std::floor(value);
}

// What observations_csv() wrote, row by row: a film of an hour has millions. Frames are those of
// `times_s`. Nothing where it is not what was written.
std::optional<std::vector<TagObservation>> read_table(const fs::path& path,
                                                      const std::vector<double>& times_s) {
  std::vector<TagObservation> out;
  std::ifstream file(path);
  std::string line;
  if (!std::getline(file, line)) return std::nullopt;  // the header
  std::array<double, kColumns> row{};
  std::size_t frame = 0;
  while (std::getline(file, line)) {
    if (!read_row(line, row)) return std::nullopt;
    const auto [t, tag, corner, u, v, sigma, hamming, margin] = row;
    if (!is_whole(tag) || !is_whole(hamming)) return std::nullopt;
    if (corner == 0.0) {
      while (frame < times_s.size() && times_s[frame] < t) ++frame;
      if (frame == times_s.size()) return std::nullopt;
      TagObservation& seen = out.emplace_back();
      seen.frame = static_cast<int>(frame);
      seen.id = TagId{static_cast<int>(tag)};
      seen.sigma_px = sigma;
      seen.hamming = static_cast<int>(hamming);
      seen.decision_margin = margin;
    }
    if (out.empty() || corner != static_cast<double>(out.back().corners_px.size()))
      return std::nullopt;
    out.back().corners_px.emplace_back(u, v);
  }
  return out;
}

// The table holds only frames with a marker; the times of all frames, what was rejected and the
// detection's warnings stand in `kept`. Nothing where the two do not belong together; throws
// json::exception where something is missing.
std::optional<TagObservations> observations_of(const json& kept, const fs::path& table) {
  TagObservations out;
  out.times_s = kept.at("times_s").get<std::vector<double>>();
  auto observations = read_table(table, out.times_s);
  if (!observations) return std::nullopt;
  out.observations = std::move(*observations);
  out.width = kept.at("width").get<int>();
  out.height = kept.at("height").get<int>();
  for (const json& tag : kept.at("rejected")) {
    const int frame = tag.at("frame").get<int>();
    if (frame < 0 || std::cmp_greater_equal(frame, out.times_s.size())) return std::nullopt;
    out.rejected.push_back(
        {frame, TagId{tag.at("id").get<int>()}, tag.at("reason").get<std::string>()});
  }
  out.warnings = kept.at("warnings").get<std::vector<std::string>>();
  out.lens_known = kept.at("lens_known").get<bool>();
  return out;
}

// What the detection depends on.
std::string detection_key(const Recording& recording, const DetectOptions& detect) {
  std::string key = fmt::format(
      "kinescope {} corners by cells, pictures twice, video {} decimate {} blur {} refine {} "
      "hamming {} margin {} "
      "sightings {} start {}",
      program_version(), sha256_of_path(recording.video), detect.detector.decimate,
      detect.detector.blur_sigma, detect.detector.refine_edges,
      detect.detector.max_hamming.value_or(-1), detect.detector.min_margin, detect.min_sightings,
      recording.settings.video_start_s);
  const MarkerSet& markers = recording.markers;
  key += fmt::format(" family {} only_listed {} ids", markers.family, markers.only_listed);
  for (const auto& [id, size] : markers.sizes_m) key += fmt::format(" {}", id.value);
  if (const auto& camera = recording.camera) {
    key += fmt::format(" lens {} {} {} {} {}", to_string(camera->model), camera->fx, camera->fy,
                       camera->cx, camera->cy);
    for (const double term : camera->distortion) key += fmt::format(" {}", term);
  }
  return key;
}

}  // namespace

std::vector<std::string> observations_files(const std::string& camera) {
  return {observations_file(camera, "csv"), observations_file(camera, "json")};
}

std::optional<TagObservations> read_kept_observations(const fs::path& folder,
                                                      const Recording& recording,
                                                      const DetectOptions& detect) {
  if (recording.entry != RecordingEntry::kVideo) return std::nullopt;
  const fs::path table = folder / observations_file(recording.camera_name, "csv");
  const fs::path key = folder / observations_file(recording.camera_name, "json");
  if (!fs::exists(table) || !fs::exists(key)) return std::nullopt;
  const json kept = json::parse(read_text_file(key), nullptr, false);
  if (!kept.is_object() || kept.value("key", json()) != detection_key(recording, detect) ||
      kept.value("sha256", json()) != sha256_of_file(table)) {
    return std::nullopt;
  }
  try {
    return observations_of(kept, table);
  } catch (const json::exception&) {
    return std::nullopt;  // damaged: the video is read once more
  }
}

std::vector<std::pair<std::string, std::string>> kept_observations(
    const Recording& recording, const TagObservations& observations, const DetectOptions& detect) {
  if (observations.observations.empty()) return {};
  std::vector<std::pair<std::string, std::string>> out;
  const std::string& table = out.emplace_back(observations_file(recording.camera_name, "csv"),
                                              observations_csv(observations))
                                 .second;
  if (recording.entry != RecordingEntry::kVideo) return out;
  json rejected = json::array();
  for (const RejectedTag& tag : observations.rejected) {
    rejected.push_back({{"frame", tag.frame}, {"id", tag.id.value}, {"reason", tag.reason}});
  }
  const json kept{{"key", detection_key(recording, detect)},
                  {"sha256", sha256_of_text(table)},
                  {"width", observations.width},
                  {"height", observations.height},
                  {"times_s", observations.times_s},
                  {"rejected", std::move(rejected)},
                  {"warnings", observations.warnings},
                  {"lens_known", observations.lens_known}};
  out.emplace_back(observations_file(recording.camera_name, "json"), json_text(kept));
  return out;
}

std::vector<InputFile> hash_inputs(const Recording& recording) {
  std::vector<InputFile> inputs;
  for (const fs::path& path : recording.files) {
    // Absolute: of several recordings the folder is, and the files are as they were given.
    const fs::path relative = fs::absolute(path).lexically_normal().lexically_relative(
        fs::absolute(recording.folder).lexically_normal());
    const bool inside = !relative.empty() && *relative.begin() != "..";
    inputs.push_back({inside ? relative.string() : path.filename().string(), sha256_of_path(path)});
  }
  return inputs;
}

}  // namespace kinescope
