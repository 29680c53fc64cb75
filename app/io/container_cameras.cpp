// SPDX-License-Identifier: Apache-2.0
#include "app/io/container_cameras.h"

#include <algorithm>
#include <cctype>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/bags/bag.h"
#include "kinematics/bags/bag_contents.h"
#include "kinematics/core/error.h"
#include "kinematics/datasets/dataset.h"

namespace kinescope {
namespace fs = std::filesystem;
namespace {

using Words = std::vector<std::string>;

Words split_at(const std::string& text, std::string_view separators) {
  Words out(1);
  for (const char c : text) {
    if (separators.find(c) != std::string_view::npos) {
      out.emplace_back();
    } else {
      out.back() += c;
    }
  }
  return out;
}

/// What stands between the commas: none of it may be empty.
Words named_parts(const fs::path& path, const std::string& names) {
  Words out = split_at(names, ",");
  if (std::ranges::find(out, "") == out.end()) return out;
  throw bad_input(path.string(), "names a camera without a name",
                  "a comma stands between two topics or cameras");
}

/// Letters, digits, '_' and '-': names of cameras are in names of files and in tables.
std::string plain_word(std::string word) {
  for (char& c : word)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-') c = '_';
  return word;
}

/// How many words all of them begin with.
std::size_t common_begin(const std::vector<Words>& all) {
  const std::size_t shortest =
      std::ranges::min(all, {}, [](const Words& words) { return words.size(); }).size();
  for (std::size_t k = 0; k < shortest; ++k) {
    const auto differs = [&](const Words& words) { return words[k] != all.front()[k]; };
    if (std::ranges::any_of(all, differs)) return k;
  }
  return shortest;
}

CameraFiles camera_of_bag_topic(const bags::Source& source, const fs::path& path,
                                RecordingEntry& entry) {
  const bags::Contents& contents = bags::look_into(source.bag);
  const bool detected = std::ranges::any_of(
      contents.detections, [&](const auto& series) { return series.topic == source.topic; });
  CameraFiles out;
  if (detected) {
    out.corners = path;
    entry = RecordingEntry::kCorners;
  } else {
    static_cast<void>(bags::choose_images(contents, source.topic));
    out.video = path;
    entry = RecordingEntry::kVideo;
  }
  if (bags::camera_of(contents, source.topic)) out.camera = path;
  return out;
}

CameraFiles camera_of_part(const fs::path& path, RecordingEntry& entry) {
  if (const auto bag = bags::bag_source(path)) return camera_of_bag_topic(*bag, path, entry);
  const auto dataset = value_of(datasets::dataset_source(path));
  static_cast<void>(datasets::choose_camera(datasets::look_into(dataset.folder), dataset));
  CameraFiles out;
  out.video = path;
  entry = RecordingEntry::kVideo;
  return out;
}

void take_intrinsics(const std::vector<fs::path>& folders, CameraFiles& camera) {
  for (const fs::path& folder : folders) {
    std::error_code error;
    fs::path file = folder / fmt::format("camera_{}.yaml", camera.name);
    if (!fs::is_regular_file(file, error)) continue;
    camera.camera = std::move(file);
    return;
  }
}

}  // namespace

std::vector<fs::path> parts_apart(const fs::path& path) {
  std::vector<fs::path> out;
  if (const auto bag = bags::bag_source(path)) {
    if (bag->topic.find(',') != std::string::npos)
      for (const std::string& topic : named_parts(path, bag->topic))
        out.emplace_back(bag->bag.string() + ":" + topic);
  } else if (const auto dataset = datasets::dataset_source(path)) {
    if (dataset->camera.find(',') != std::string::npos)
      for (const std::string& camera : named_parts(path, dataset->camera))
        out.push_back(datasets::Source{dataset->folder, camera, dataset->episodes}.path());
  }
  if (out.empty()) out.push_back(path);
  return out;
}

std::vector<std::string> names_of_parts(const std::vector<std::string>& parts) {
  std::vector<Words> words;
  for (const std::string& part : parts) words.push_back(split_at(part, "/."));
  for (const bool back : {false, true}) {
    if (back)
      for (Words& own : words) std::ranges::reverse(own);
    const auto shared = static_cast<std::ptrdiff_t>(common_begin(words));
    for (Words& own : words) own.erase(own.begin(), own.begin() + shared);
    if (back)
      for (Words& own : words) std::ranges::reverse(own);
  }
  std::vector<std::string> out;
  for (const Words& own : words) out.push_back(plain_word(fmt::format("{}", fmt::join(own, "_"))));
  const std::set<std::string> different(out.begin(), out.end());
  if (different.size() == out.size() && !different.contains("")) return out;
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = fmt::format("camera{}", k + 1);
  return out;
}

void take_cameras(const std::vector<fs::path>& parts, const std::vector<fs::path>& folders,
                  RecordingFiles& files) {
  std::vector<std::string> keys;
  for (const fs::path& path : parts) {
    const auto dataset = datasets::dataset_source(path);
    const std::string key = dataset ? dataset->camera : value_of(bags::bag_source(path)).topic;
    if (std::ranges::find(keys, key) != keys.end())
      throw bad_input(path.string(), "is named twice", "name each camera once");
    keys.push_back(key);
  }
  const std::vector<std::string> names = names_of_parts(keys);
  for (std::size_t k = 0; k < parts.size(); ++k) {
    RecordingEntry entry{};
    CameraFiles camera = camera_of_part(parts[k], entry);
    if (k > 0 && entry != files.entry) {
      throw bad_input(parts[k].string(),
                      fmt::format("holds {}, and {} holds {}", to_string(entry), keys.front(),
                                  to_string(files.entry)),
                      "name topics of images, or topics of detections");
    }
    files.entry = entry;
    camera.name = names[k];
    take_intrinsics(folders, camera);
    files.cameras.push_back(std::move(camera));
  }
  std::ranges::sort(files.cameras, {}, &CameraFiles::name);
}

}  // namespace kinescope
