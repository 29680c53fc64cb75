// SPDX-License-Identifier: Apache-2.0
#include "kinematics/datasets/dataset.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/core/error.h"
#include "kinematics/core/memo.h"
#include "kinematics/datasets/dataset_files.h"

namespace kinescope::datasets {
namespace fs = std::filesystem;
namespace {

/// "3", "0-9".
std::optional<EpisodeRange> episode_range(std::string_view text) {
  constexpr std::size_t kMostDigits = 9;
  const auto number = [](std::string_view digits) -> std::optional<std::size_t> {
    if (digits.empty() || digits.size() > kMostDigits) return std::nullopt;
    std::size_t out = 0;
    for (const char digit : digits) {
      if (digit < '0' || digit > '9') return std::nullopt;
      out = 10 * out + static_cast<std::size_t>(digit - '0');
    }
    return out;
  };
  const std::size_t dash = text.find('-');
  const auto first = number(text.substr(0, dash));
  if (dash == std::string_view::npos)
    return first ? std::optional(EpisodeRange{*first, *first}) : std::nullopt;
  const auto last = number(text.substr(dash + 1));
  if (!first || !last) return std::nullopt;
  return EpisodeRange{*first, *last};
}

/// What stands behind the folder: a camera, episodes, or both.
void take_choice(std::string_view text, Source& source) {
  const std::size_t colon = text.rfind(':');
  const std::string_view last = colon == std::string_view::npos ? text : text.substr(colon + 1);
  source.episodes = episode_range(last);
  if (!source.episodes) {
    source.camera = text;
  } else if (colon != std::string_view::npos) {
    source.camera = text.substr(0, colon);
  }
}

bool is_dataset_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(info_file(path), error);
}

/// Changes with the files.
std::string key_of_dataset(const fs::path& folder) {
  std::string key = folder.string();
  for (const fs::path& file : metadata_files(folder)) {
    std::error_code error;
    const auto size = fs::file_size(file, error);
    const auto written = fs::last_write_time(file, error).time_since_epoch().count();
    key += fmt::format("|{} {} {}", file.string(), size, written);
  }
  return key;
}

}  // namespace

fs::path Source::path() const {
  std::string out = folder.string();
  if (!camera.empty()) out += ":" + camera;
  if (!episodes) return out;
  out += fmt::format(":{}", episodes->first);
  return episodes->last == episodes->first ? out : out + fmt::format("-{}", episodes->last);
}

std::optional<Source> dataset_source(const fs::path& path) {
  const auto without_slash = [](const fs::path& folder) {
    return folder.has_filename() ? folder : folder.parent_path();
  };
  if (is_dataset_folder(path)) return Source{without_slash(path), {}, {}};
  const std::string text = path.string();
  std::error_code error;
  for (std::size_t colon = fs::exists(path, error) ? std::string::npos : text.find(':');
       colon != std::string::npos; colon = text.find(':', colon + 1)) {
    const fs::path folder = text.substr(0, colon);
    if (colon + 1 == text.size() || !is_dataset_folder(folder)) continue;
    Source out{without_slash(folder), {}, {}};
    take_choice(std::string_view(text).substr(colon + 1), out);
    return out;
  }
  return std::nullopt;
}

const Feature* Dataset::feature(const std::string& name) const {
  const auto found = std::ranges::find(features, name, &Feature::name);
  return found == features.end() ? nullptr : &*found;
}

Dataset read_dataset(const fs::path& folder) {
  Info info = read_info(folder);
  Dataset out = std::move(info.dataset);
  out.metadata = metadata_files(folder);
  out.episodes =
      info.is_version_3 ? episodes_of_version_3(info, out) : episodes_of_version_2(info, out);
  std::ranges::sort(out.episodes, {}, &Episode::index);
  const auto twice = std::ranges::adjacent_find(out.episodes, {}, &Episode::index);
  if (twice != out.episodes.end()) {
    throw bad_input((folder / "meta").string(),
                    fmt::format("episode {} is listed twice", twice->index),
                    "copy the dataset again");
  }
  if (info.total_episodes && *info.total_episodes != out.episodes.size()) {
    out.warnings.push_back(fmt::format("{}: total_episodes is {}, and {} are listed",
                                       info_file(folder).string(), *info.total_episodes,
                                       out.episodes.size()));
  }
  return out;
}

const Dataset& look_into(const fs::path& folder) {
  static const Memo<std::string, Dataset> read;  // a dataset is asked for joints, images, files
  return read.get(key_of_dataset(folder), [&] { return read_dataset(folder); });
}

}  // namespace kinescope::datasets
