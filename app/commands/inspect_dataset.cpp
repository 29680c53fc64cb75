// SPDX-License-Identifier: Apache-2.0
#include "app/commands/inspect_dataset.h"

#include <algorithm>
#include <numeric>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using datasets::Dataset;
using datasets::Episode;
using datasets::Feature;

std::size_t frames_of(const Dataset& dataset) {
  return std::accumulate(
      dataset.episodes.begin(), dataset.episodes.end(), std::size_t{0},
      [](std::size_t sum, const Episode& episode) { return sum + episode.frames; });
}

std::string episode_words(const Dataset& dataset) {
  if (dataset.episodes.empty()) return "none";
  const auto [shortest, longest] = std::ranges::minmax(dataset.episodes, {}, &Episode::frames);
  return fmt::format("{} to {}, of {:.1f} to {:.1f} s", dataset.episodes.front().index,
                     dataset.episodes.back().index,
                     static_cast<double>(shortest.frames) / dataset.frame_rate_hz,
                     static_cast<double>(longest.frames) / dataset.frame_rate_hz);
}

std::vector<std::string> tasks_of(const Dataset& dataset) {
  std::set<std::string> out;
  for (const Episode& episode : dataset.episodes)
    out.insert(episode.tasks.begin(), episode.tasks.end());
  return {out.begin(), out.end()};
}

/// What LeRobot adds to every row.
bool is_counter(const Feature& feature) {
  static const std::set<std::string> kCounters = {"timestamp", "frame_index", "episode_index",
                                                  "index", "task_index"};
  return kCounters.contains(feature.name);
}

std::string feature_words(const Feature& feature) {
  std::string out = fmt::format("{} {}", fmt::join(feature.shape, " x "), feature.dtype);
  if (feature.is_depth) out += ", depths: not used";
  if (feature.dtype == "image") out += ": not read, convert it to videos";
  if (!feature.names.empty()) out += fmt::format(": {}", fmt::join(feature.names, ", "));
  return out;
}

std::string chosen_words(const Dataset& dataset, const datasets::Source& source) {
  try {
    const std::size_t count = datasets::choose_episodes(dataset, source).episodes.size();
    if (count == dataset.episodes.size()) return count == 1 ? "used" : "all used, joined";
    return fmt::format("{} used{}", count, count == 1 ? "" : ", joined");
  } catch (const Error&) {
    return "none used";
  }
}

}  // namespace

void print_dataset(const Dataset& dataset, const datasets::Source& source) {
  fmt::print("dataset   LeRobot {}, {}, {} frames, {:g} frames/s\n", dataset.version,
             dataset.robot_type.empty() ? "robot not named" : "robot " + dataset.robot_type,
             frames_of(dataset), dataset.frame_rate_hz);
  fmt::print("episodes  {}; {}\n", episode_words(dataset), chosen_words(dataset, source));
  constexpr std::size_t kMostTasks = 4;
  std::vector<std::string> tasks = tasks_of(dataset);
  const std::size_t more = tasks.size() > kMostTasks ? tasks.size() - kMostTasks : 0;
  tasks.resize(tasks.size() - more);
  if (!tasks.empty()) {
    fmt::print("tasks     {}{}\n", fmt::join(tasks, "; "),
               more > 0 ? fmt::format("; and {} more", more) : "");
  }
  for (const Feature& feature : dataset.features) {
    if (is_counter(feature)) continue;
    fmt::print("{}{}: {}\n", feature.is_video() && !feature.is_depth ? "camera    " : "feature   ",
               feature.name, feature_words(feature));
  }
}

nlohmann::json dataset_json(const Dataset& dataset) {
  nlohmann::json out = {{"version", dataset.version},
                        {"robot_type", dataset.robot_type},
                        {"frame_rate_hz", dataset.frame_rate_hz},
                        {"frames", frames_of(dataset)},
                        {"tasks", tasks_of(dataset)},
                        {"episodes", nlohmann::json::array()},
                        {"features", nlohmann::json::array()}};
  for (const Episode& episode : dataset.episodes)
    out["episodes"].push_back({{"index", episode.index}, {"frames", episode.frames}});
  for (const Feature& feature : dataset.features) {
    out["features"].push_back({{"name", feature.name},
                               {"dtype", feature.dtype},
                               {"shape", feature.shape},
                               {"names", feature.names},
                               {"camera", feature.is_video() && !feature.is_depth}});
  }
  return out;
}

}  // namespace kinescope
