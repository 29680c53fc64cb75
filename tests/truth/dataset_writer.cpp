// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/dataset_writer.h"

#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace kinescope::truth {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

bool is_version_3(const DatasetFields& fields) { return fields.version == "v3.0"; }

void write_json(const fs::path& path, const json& document) {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << document.dump(1) << "\n";
}

json features_of(const DatasetFields& fields) {
  const json names = fields.joints.empty() ? json(nullptr) : json(fields.joints);
  const std::size_t size = fields.episodes.front().state.front().size();
  const json row = {{"dtype", "float32"}, {"shape", {size}}, {"names", names}};
  json out = {{"observation.state", row}, {"action", row}};
  if (!fields.episodes.front().effort.empty()) out["observation.effort"] = row;
  for (const std::string& camera : fields.cameras) {
    out[camera] = {{"dtype", "video"},
                   {"shape", {fields.height, fields.width, 3}},
                   {"names", {"height", "width", "channels"}},
                   {"info", {{"video.is_depth_map", false}}}};
  }
  for (const char* counter : {"frame_index", "episode_index", "index", "task_index"})
    out[counter] = {{"dtype", "int64"}, {"shape", {1}}, {"names", nullptr}};
  out["timestamp"] = {{"dtype", "float32"}, {"shape", {1}}, {"names", nullptr}};
  return out;
}

void write_info(const fs::path& folder, const DatasetFields& fields) {
  std::size_t frames = 0;
  for (const DatasetEpisode& episode : fields.episodes) frames += episode.state.size();
  const char* data = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet";
  const char* video =
      "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4";
  if (is_version_3(fields)) {
    data = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet";
    video = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4";
  }
  write_json(folder / "meta/info.json", {{"codebase_version", fields.version},
                                         {"robot_type", fields.robot_type},
                                         {"total_episodes", fields.episodes.size()},
                                         {"total_frames", frames},
                                         {"chunks_size", 1000},
                                         {"fps", fields.frame_rate_hz},
                                         {"data_path", data},
                                         {"video_path", video},
                                         {"features", features_of(fields)}});
}

/// Rows of some episodes as a file's columns.
class RowColumns {
 public:
  explicit RowColumns(int frame_rate_hz) : frame_rate_hz_(frame_rate_hz) {}

  void add(const DatasetEpisode& episode, int index) {
    for (std::size_t frame = 0; frame < episode.state.size(); ++frame) {
      state_.push_back(episode.state[frame]);
      action_.push_back(episode.action[frame]);
      if (!episode.effort.empty()) effort_.push_back(episode.effort[frame]);
      stamp_.push_back(static_cast<float>(frame) / static_cast<float>(frame_rate_hz_));
      frame_.push_back(static_cast<std::int64_t>(frame));
      episode_.push_back(index);
    }
  }

  [[nodiscard]] std::vector<ParquetColumn> columns() const {
    std::vector<ParquetColumn> out{{"observation.state", state_}, {"action", action_}};
    if (!effort_.empty()) out.push_back({"observation.effort", effort_});
    out.push_back({"timestamp", stamp_});
    out.push_back({"frame_index", frame_});
    out.push_back({"episode_index", episode_});
    return out;
  }

 private:
  int frame_rate_hz_;
  FloatRows state_, action_, effort_;
  std::vector<float> stamp_;
  std::vector<std::int64_t> frame_, episode_;
};

void write_version_2(const fs::path& folder, const DatasetFields& fields) {
  std::ofstream lines(folder / "meta/episodes.jsonl");
  for (std::size_t i = 0; i < fields.episodes.size(); ++i) {
    const auto index = static_cast<int>(i);
    RowColumns rows(fields.frame_rate_hz);
    rows.add(fields.episodes[i], index);
    write_parquet(folder / fmt::format("data/chunk-000/episode_{:06d}.parquet", index),
                  rows.columns());
    const json line = {{"episode_index", index},
                       {"tasks", {"move about"}},
                       {"length", fields.episodes[i].state.size()}};
    lines << line.dump() << "\n";
  }
}

void write_version_3(const fs::path& folder, const DatasetFields& fields) {
  RowColumns rows(fields.frame_rate_hz);
  std::vector<std::int64_t> index, length, first;
  std::vector<double> from_s;
  std::vector<std::string> tasks;
  std::int64_t frames = 0;
  for (std::size_t i = 0; i < fields.episodes.size(); ++i) {
    rows.add(fields.episodes[i], static_cast<int>(i));
    index.push_back(static_cast<std::int64_t>(i));
    length.push_back(static_cast<std::int64_t>(fields.episodes[i].state.size()));
    first.push_back(0);
    from_s.push_back(static_cast<double>(frames) / fields.frame_rate_hz);
    tasks.emplace_back("move about");
    frames += length.back();
  }
  write_parquet(folder / "data/chunk-000/file-000.parquet", rows.columns());
  std::vector<ParquetColumn> table{{"episode_index", index},
                                   {"tasks", tasks},
                                   {"length", length},
                                   {"data/chunk_index", first},
                                   {"data/file_index", first}};
  for (const std::string& camera : fields.cameras) {
    table.push_back({"videos/" + camera + "/chunk_index", first});
    table.push_back({"videos/" + camera + "/file_index", first});
    table.push_back({"videos/" + camera + "/from_timestamp", from_s});
  }
  write_parquet(folder / "meta/episodes/chunk-000/file-000.parquet", table);
}

}  // namespace

void write_dataset(const fs::path& folder, const DatasetFields& fields) {
  write_info(folder, fields);
  if (is_version_3(fields)) {
    write_version_3(folder, fields);
  } else {
    write_version_2(folder, fields);
  }
}

fs::path video_of_dataset(const fs::path& folder, const DatasetFields& fields,
                          const std::string& camera, int episode) {
  if (is_version_3(fields)) return folder / "videos" / camera / "chunk-000/file-000.mp4";
  return folder / "videos/chunk-000" / camera / fmt::format("episode_{:06d}.mp4", episode);
}

}  // namespace kinescope::truth
