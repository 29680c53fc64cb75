// SPDX-License-Identifier: Apache-2.0
//
// What `kinescope run --shard i/n` leaves, and `kinescope merge` goes on from: in a folder of its
// own part.json (schema: app/io/schema/part.schema.json), written last, and of every recording of
// the shard that holds a video what was detected (kept_observations.h). All else that a run reads
// is read again: it costs nothing beside the videos.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/io/recording.h"
#include "app/io/shard.h"
#include "app/report/run_summary.h"
#include "calib/vision/detect.h"

namespace kinescope {

inline constexpr std::string_view kPartFile = "part.json";

struct PartOfRecording {
  std::string name;               ///< among all (recording_names())
  std::vector<InputFile> inputs;  ///< everything that was read of it
  std::vector<InputFile> files;   ///< of the part's folder: what was detected
};

struct ShardPart {
  std::filesystem::path folder;  ///< that it lies in
  std::string version;           ///< of the program
  Shard shard;
  std::vector<std::string> arguments;   ///< of the run, without what a shard has of its own
  std::string working_folder;           ///< that they are seen from
  std::vector<std::string> recordings;  ///< names of all of the run, sorted
  std::vector<PartOfRecording> parts;   ///< of this shard
};

[[nodiscard]] nlohmann::json part_json(const ShardPart& part);

/// Throws bad_input: no part, one that is damaged or cut off, or one of its files is.
[[nodiscard]] ShardPart read_part(const std::filesystem::path& folder);

/// Throws bad_input where one is of another version than this program, bad_request where they are
/// not of one run, two are the same shard, or one is missing.
void require_all_parts(const std::vector<ShardPart>& parts);

/// Throws bad_input where a recording is another one than when its part was made, and names the
/// file. Without parts nothing is asked.
void require_unchanged(const std::vector<ShardPart>& parts, const std::vector<Recording>& given);

/// What the parts have of the recording; nothing where that is not there.
[[nodiscard]] std::optional<TagObservations> observations_in(const std::vector<ShardPart>& parts,
                                                             const Recording& recording,
                                                             const DetectOptions& detect);

}  // namespace kinescope
