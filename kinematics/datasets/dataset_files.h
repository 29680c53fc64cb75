// SPDX-License-Identifier: Apache-2.0
//
// The files of a dataset's metadata, one by one.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "kinematics/datasets/dataset.h"

namespace kinescope::datasets {

/// meta/info.json.
[[nodiscard]] std::filesystem::path info_file(const std::filesystem::path& folder);
/// It, and those that list the episodes, sorted.
[[nodiscard]] std::vector<std::filesystem::path> metadata_files(
    const std::filesystem::path& folder);

struct Info {
  Dataset dataset;  ///< without episodes
  bool is_version_3 = false;
  std::optional<std::size_t> total_episodes;
  std::size_t chunk_size = 1000;
  std::string data_path, video_path;  ///< templates of Python's format(); the second may be empty
};
/// Throws bad_input.
[[nodiscard]] Info read_info(const std::filesystem::path& folder);

/// meta/episodes.jsonl; without it as many as info.json says. Throws bad_input.
[[nodiscard]] std::vector<Episode> episodes_of_version_2(const Info& info, const Dataset& dataset);
/// meta/episodes/chunk-000/file-000.parquet and its like. Throws bad_input.
[[nodiscard]] std::vector<Episode> episodes_of_version_3(const Info& info, const Dataset& dataset);

/// A template's fields: "{episode_index:06d}" by number, "{video_key}" by text.
struct PathFields {
  std::map<std::string, std::size_t> numbers;
  std::map<std::string, std::string> texts;
};
/// The file in `folder` that a template gives. Throws bad_input: a field that is not known, a path
/// out of the folder (absolute, with "..").
[[nodiscard]] std::filesystem::path file_of_template(const std::filesystem::path& folder,
                                                     const std::string& pattern,
                                                     const PathFields& fields);

/// The most episodes of a dataset; the largest published have some hundred thousand.
inline constexpr std::size_t kMostEpisodes = 10'000'000;

}  // namespace kinescope::datasets
