// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"
#include "kinematics/datasets/dataset.h"

namespace kinescope::datasets {
namespace fs = std::filesystem;
namespace {

bool is_camera(const Feature& feature) { return feature.is_video() && !feature.is_depth; }

std::vector<std::string> camera_names(const Dataset& dataset) {
  std::vector<std::string> out;
  for (const Feature& feature : dataset.features)
    if (is_camera(feature)) out.push_back(feature.name);
  return out;
}

[[noreturn]] void refuse_no_video(const Dataset& dataset) {
  const auto image = std::ranges::find(dataset.features, "image", &Feature::dtype);
  std::vector<std::string> names;
  for (const Feature& feature : dataset.features) names.push_back(feature.name);
  if (image != dataset.features.end()) {
    throw bad_input(
        dataset.folder.string(),
        fmt::format("keeps the images of {} as single images, which are not read", image->name),
        "convert the dataset to videos with LeRobot");
  }
  throw bad_input(dataset.folder.string(),
                  fmt::format("holds no video: its features are {}", fmt::join(names, ", ")),
                  "record it with a camera that sees the markers");
}

}  // namespace

Joined choose_episodes(const Dataset& dataset, const Source& source) {
  Joined out;
  double start_s = 0.0;
  for (const Episode& episode : dataset.episodes) {
    const bool wanted = !source.episodes || (episode.index >= source.episodes->first &&
                                             episode.index <= source.episodes->last);
    if (!wanted || episode.frames == 0) continue;
    out.episodes.push_back(&episode);
    out.starts_s.push_back(start_s);
    start_s += static_cast<double>(episode.frames) / dataset.frame_rate_hz + kBetweenEpisodesS;
  }
  if (!out.episodes.empty()) return out;
  const std::string place = source.path().string();
  if (dataset.episodes.empty())
    throw bad_input(place, "holds no episode", "record one, or copy the dataset again");
  throw bad_input(place,
                  fmt::format("holds no frame: episodes are {} to {}",
                              dataset.episodes.front().index, dataset.episodes.back().index),
                  "name one that is there");
}

const Feature& choose_camera(const Dataset& dataset, const Source& source) {
  const std::vector<std::string> cameras = camera_names(dataset);
  if (!source.camera.empty()) {
    const Feature* named = dataset.feature(source.camera);
    if (named != nullptr && named->is_video()) return *named;
    if (cameras.empty()) refuse_no_video(dataset);
    throw bad_input(source.path().string(), named == nullptr ? "no such camera" : "is no video",
                    fmt::format("the dataset has {}", fmt::join(cameras, ", ")));
  }
  if (cameras.empty()) refuse_no_video(dataset);
  if (cameras.size() == 1) return *dataset.feature(cameras.front());
  throw bad_input(dataset.folder.string(),
                  fmt::format("holds {} cameras: {}", cameras.size(), fmt::join(cameras, ", ")),
                  fmt::format("name the one that stands still and sees the markers: {0}:{1}, or "
                              "several that do: {0}:{1},{2}",
                              dataset.folder.string(), cameras[0], cameras[1]));
}

bool shows_robot(const Dataset& dataset) { return !camera_names(dataset).empty(); }

std::vector<fs::path> files_of(const Source& source) {
  const Dataset& dataset = look_into(source.folder);
  std::vector<fs::path> out;
  for (const Episode* episode : choose_episodes(dataset, source).episodes) {
    const auto video = episode->videos.find(source.camera);
    if (source.camera.empty()) {
      out.push_back(episode->rows);
    } else if (video != episode->videos.end()) {
      out.push_back(video->second.file);
    }
  }
  std::ranges::sort(out);
  const auto again = std::ranges::unique(out);
  out.erase(again.begin(), again.end());
  out.insert(out.begin(), dataset.metadata.begin(), dataset.metadata.end());
  return out;
}

}  // namespace kinescope::datasets
