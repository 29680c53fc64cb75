// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <sstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/datasets/dataset_files.h"
#include "kinematics/parquet/parquet_file.h"

namespace kinescope::datasets {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

fs::path episodes_folder(const fs::path& folder) { return folder / "meta" / "episodes"; }
fs::path episodes_lines(const fs::path& folder) { return folder / "meta" / "episodes.jsonl"; }

/// One field of a template, "{name}" or "{name:06d}"; `at` is behind it then.
std::string field_text(const std::string& pattern, std::size_t& at, const PathFields& fields,
                       const std::string& place) {
  const std::size_t end = pattern.find('}', at);
  const auto refuse = [&](const std::string& what) {
    return bad_input(place, fmt::format("{} in the path '{}'", what, pattern),
                     "write it as LeRobot does");
  };
  if (end == std::string::npos) throw refuse("a brace without its other");
  const std::string inside = pattern.substr(at + 1, end - at - 1);
  at = end + 1;
  const std::size_t colon = inside.find(':');
  const std::string name = inside.substr(0, colon);
  const std::string format = colon == std::string::npos ? "" : inside.substr(colon + 1);
  if (const auto text = fields.texts.find(name); text != fields.texts.end() && format.empty())
    return text->second;
  const auto number = fields.numbers.find(name);
  if (number == fields.numbers.end()) throw refuse(fmt::format("an unknown field '{}'", name));
  if (format.empty() || format == "d") return fmt::format("{}", number->second);
  const bool padded = format.size() == 3 && format[0] == '0' && format[1] >= '1' &&
                      format[1] <= '9' && format[2] == 'd';
  if (!padded) throw refuse(fmt::format("an unknown format '{}'", format));
  return fmt::format("{:0{}d}", number->second, format[1] - '0');
}

/// A whole number of a table, at most kMostEpisodes.
std::size_t index_at(const parquet::Numbers& column, std::size_t row, const std::string& place) {
  const double value = column.size_of(row) == 1 ? column.values[column.begin_of(row)] : -1.0;
  if (value >= 0.0 && value <= static_cast<double>(kMostEpisodes) && value == std::floor(value))
    return static_cast<std::size_t>(value);
  throw bad_input(place, fmt::format("row {} has {}, which is no index", row + 1, value),
                  "copy the dataset again");
}

std::vector<std::string> video_names(const Dataset& dataset) {
  std::vector<std::string> out;
  for (const Feature& feature : dataset.features)
    if (feature.is_video()) out.push_back(feature.name);
  return out;
}

/// One file of meta/episodes as its columns.
class EpisodeTable {
 public:
  explicit EpisodeTable(const fs::path& path) : path_(path), file_(path) {}

  [[nodiscard]] std::size_t rows() const { return file_.rows(); }
  [[nodiscard]] bool has(const std::string& name) const { return file_.has(name); }
  [[nodiscard]] std::size_t index(const std::string& name, std::size_t row) {
    return index_at(column(name), row, fmt::format("{}: column '{}'", path_.string(), name));
  }
  [[nodiscard]] double stamp_s(const std::string& name, std::size_t row) {
    const parquet::Numbers& values = column(name);
    const double out = values.size_of(row) == 1 ? values.values[values.begin_of(row)] : -1.0;
    constexpr double kLongestS = 1e7;
    if (out >= 0.0 && out < kLongestS) return out;
    throw bad_input(fmt::format("{}: column '{}'", path_.string(), name),
                    fmt::format("row {} has {}, which is no time in a video", row + 1, out),
                    "copy the dataset again");
  }
  [[nodiscard]] std::vector<std::string> tasks(std::size_t row) {
    if (!texts_) texts_ = has("tasks") ? file_.texts("tasks") : parquet::Texts{};
    if (row >= texts_->rows()) return {};
    const auto begin = texts_->values.begin();
    return {begin + static_cast<std::ptrdiff_t>(texts_->begin_of(row)),
            begin + static_cast<std::ptrdiff_t>(texts_->ends[row])};
  }

 private:
  const parquet::Numbers& column(const std::string& name) {
    const auto found = columns_.find(name);
    if (found != columns_.end()) return found->second;
    return columns_.emplace(name, file_.numbers(name)).first->second;
  }

  fs::path path_;
  parquet::File file_;
  std::map<std::string, parquet::Numbers> columns_;
  std::optional<parquet::Texts> texts_;
};

Episode episode_of_row(EpisodeTable& table, std::size_t row, const Info& info,
                       const std::vector<std::string>& cameras, const fs::path& folder) {
  Episode out;
  out.index = table.index("episode_index", row);
  out.frames = table.index("length", row);
  out.tasks = table.tasks(row);
  const auto place = [&](const std::string& of) {
    PathFields fields;
    fields.numbers["chunk_index"] = table.index(of + "/chunk_index", row);
    fields.numbers["file_index"] = table.index(of + "/file_index", row);
    return fields;
  };
  out.rows = file_of_template(folder, info.data_path, place("data"));
  for (const std::string& camera : cameras) {
    if (!table.has("videos/" + camera + "/chunk_index")) continue;
    PathFields fields = place("videos/" + camera);
    fields.texts["video_key"] = camera;
    out.videos[camera] = {file_of_template(folder, info.video_path, fields),
                          table.stamp_s("videos/" + camera + "/from_timestamp", row)};
  }
  return out;
}

/// What a line of episodes.jsonl says.
Episode episode_of_line(const std::string& line, const std::string& place) {
  const json object = json::parse(line, nullptr, false);
  const auto wrong = [&](const char* what) { return bad_input(place, what, "copy it again"); };
  if (!object.is_object()) throw wrong("is no JSON object");
  const auto index_of = [&](const char* key) {
    const auto found = object.find(key);
    if (found == object.end() || !found->is_number_integer() || found->get<std::int64_t>() < 0 ||
        found->get<std::int64_t>() > static_cast<std::int64_t>(kMostEpisodes)) {
      throw wrong(fmt::format("has no {}", key).c_str());
    }
    return found->get<std::size_t>();
  };
  Episode out;
  out.index = index_of("episode_index");
  out.frames = index_of("length");
  const auto tasks = object.find("tasks");
  if (tasks != object.end() && tasks->is_array()) {
    for (const json& task : *tasks)
      if (task.is_string()) out.tasks.push_back(task.get<std::string>());
  }
  return out;
}

void place_files(Episode& episode, const Info& info, const std::vector<std::string>& cameras,
                 const fs::path& folder) {
  PathFields fields;
  fields.numbers["episode_index"] = episode.index;
  fields.numbers["episode_chunk"] = episode.index / info.chunk_size;
  episode.rows = file_of_template(folder, info.data_path, fields);
  for (const std::string& camera : cameras) {
    fields.texts["video_key"] = camera;
    episode.videos[camera] = {file_of_template(folder, info.video_path, fields), 0.0};
  }
}

}  // namespace

fs::path file_of_template(const fs::path& folder, const std::string& pattern,
                          const PathFields& fields) {
  const std::string place = info_file(folder).string();
  std::string text;
  for (std::size_t at = 0; at < pattern.size();) {
    if (pattern[at] == '{') {
      text += field_text(pattern, at, fields, place);
    } else {
      text += pattern[at++];
    }
  }
  const fs::path path = text;
  const bool leads_out =
      path.empty() || path.is_absolute() || std::ranges::find(path, fs::path("..")) != path.end();
  if (leads_out) {
    throw bad_input(place, fmt::format("the path '{}' leads out of the dataset", text),
                    "is it from somebody you trust? copy it again");
  }
  return folder / path;
}

std::vector<fs::path> metadata_files(const fs::path& folder) {
  std::vector<fs::path> out{info_file(folder)};
  std::error_code error;
  if (fs::is_regular_file(episodes_lines(folder), error)) out.push_back(episodes_lines(folder));
  std::vector<fs::path> tables;
  for (const fs::directory_entry& chunk : fs::directory_iterator(episodes_folder(folder), error)) {
    std::error_code no_folder;
    for (const fs::directory_entry& file : fs::directory_iterator(chunk.path(), no_folder))
      if (file.path().extension() == ".parquet") tables.push_back(file.path());
  }
  std::ranges::sort(tables);
  out.insert(out.end(), tables.begin(), tables.end());
  return out;
}

std::vector<Episode> episodes_of_version_2(const Info& info, const Dataset& dataset) {
  const fs::path lines = episodes_lines(dataset.folder);
  std::vector<Episode> out;
  std::error_code error;
  if (!fs::exists(lines, error))
    throw bad_input(lines.string(), "no such file", "copy the dataset again");
  std::istringstream text(read_text_file(lines));
  std::string line;
  for (std::size_t number = 1; std::getline(text, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    out.push_back(episode_of_line(line, fmt::format("{}:{}", lines.string(), number)));
  }
  const std::vector<std::string> cameras = video_names(dataset);
  for (Episode& episode : out) place_files(episode, info, cameras, dataset.folder);
  return out;
}

std::vector<Episode> episodes_of_version_3(const Info& info, const Dataset& dataset) {
  const std::vector<std::string> cameras = video_names(dataset);
  std::vector<Episode> out;
  for (const fs::path& path : metadata_files(dataset.folder)) {
    if (path.extension() != ".parquet") continue;
    EpisodeTable table(path);
    for (std::size_t row = 0; row < table.rows(); ++row)
      out.push_back(episode_of_row(table, row, info, cameras, dataset.folder));
  }
  if (!out.empty()) return out;
  throw bad_input(episodes_folder(dataset.folder).string(), "lists no episode",
                  "copy the dataset again, or record it to its end");
}

}  // namespace kinescope::datasets
