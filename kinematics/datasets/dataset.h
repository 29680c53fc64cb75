// SPDX-License-Identifier: Apache-2.0
//
// Takes   the folder of a LeRobot dataset, version 2.0, 2.1 or 3.0.
// Gives   what it holds: features, episodes, and in which file each episode's rows and images are.
// Units   s after an episode's first frame; values as recorded.
// Method  meta/info.json, meta/episodes.jsonl (2.x) or meta/episodes/*/*.parquet (3.0), as
//         https://huggingface.co/docs/lerobot/lerobot-dataset-v3 describes them. Paths lead to
//         files in the folder, or are refused.
// Not here: the rows (dataset_log.h), the images (calib/vision/dataset_video.h).
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace kinescope::datasets {

/// Episodes by number, from one to another.
struct EpisodeRange {
  std::size_t first = 0, last = 0;
};

/// A dataset, and what of it where `path` goes on: "FOLDER:observation.images.top",
/// "FOLDER:3" (an episode), "FOLDER:0-9", "FOLDER:observation.images.top:0-9".
struct Source {
  std::filesystem::path folder;
  std::string camera;                    ///< empty: not said
  std::optional<EpisodeRange> episodes;  ///< nothing: all
  /// As `path` says it.
  [[nodiscard]] std::filesystem::path path() const;
};

/// Nothing where `path` names no folder with meta/info.json.
[[nodiscard]] std::optional<Source> dataset_source(const std::filesystem::path& path);

struct Feature {
  std::string name;   ///< "observation.state"
  std::string dtype;  ///< "float32", "video", "image", ..
  std::vector<std::size_t> shape;
  std::vector<std::string> names;  ///< of the elements; as many as there are, or none
  bool is_depth = false;

  [[nodiscard]] bool is_video() const { return dtype == "video"; }
};

/// An episode's part of a video file.
struct VideoPart {
  std::filesystem::path file;
  double from_s = 0.0;  ///< stamp of its first frame in the file
};

struct Episode {
  std::size_t index = 0;
  std::size_t frames = 0;
  std::filesystem::path rows;               ///< Parquet file
  std::map<std::string, VideoPart> videos;  ///< by the feature's name
  std::vector<std::string> tasks;
};

struct Dataset {
  std::filesystem::path folder;
  std::string version;     ///< "v3.0"
  std::string robot_type;  ///< empty where not said
  double frame_rate_hz = 0.0;
  std::vector<Feature> features;                ///< by name
  std::vector<Episode> episodes;                ///< by number
  std::vector<std::filesystem::path> metadata;  ///< files that this is from
  std::vector<std::string> warnings;

  [[nodiscard]] const Feature* feature(const std::string& name) const;
};

/// Reads the metadata. Throws bad_input that names file and remedy: missing, no JSON, another
/// version, counts, names or paths that cannot be.
[[nodiscard]] Dataset read_dataset(const std::filesystem::path& folder);
/// The same, read once for all who ask.
[[nodiscard]] const Dataset& look_into(const std::filesystem::path& folder);

/// The episodes that are asked for, one after the other on one clock.
struct Joined {
  std::vector<const Episode*> episodes;
  std::vector<double> starts_s;  ///< of the first frame of each
};
/// Between two episodes the robot was moved unseen: nothing is interpolated over so long a gap
/// (kMaxGap of joint_log.h).
inline constexpr double kBetweenEpisodesS = 1.0;

/// Throws bad_input: no such episode, none at all.
[[nodiscard]] Joined choose_episodes(const Dataset& dataset, const Source& source);

/// The camera that `source` names, else the only one (not of depths). Throws bad_input, naming
/// them: none, several, no such camera, one whose images are no video.
[[nodiscard]] const Feature& choose_camera(const Dataset& dataset, const Source& source);
/// True where there is a video that is not of depths.
[[nodiscard]] bool shows_robot(const Dataset& dataset);

/// The files that the source stands for: metadata, then rows, or the videos of the camera that it
/// names. Throws as those above.
[[nodiscard]] std::vector<std::filesystem::path> files_of(const Source& source);

}  // namespace kinescope::datasets
