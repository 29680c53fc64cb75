// SPDX-License-Identifier: Apache-2.0
//
// LeRobot datasets as a test makes them: version 2.1 or 3.0, without their videos.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/truth/parquet_writer.h"

namespace kinescope::truth {

using FloatRows = std::vector<std::vector<float>>;

struct DatasetEpisode {
  FloatRows state, action;
  FloatRows effort;  ///< none: the dataset has no efforts
};

struct DatasetFields {
  std::string version = "v2.1";
  std::string robot_type = "so101_follower";
  int frame_rate_hz = 30;
  std::vector<std::string> joints;  ///< "shoulder_pan.pos"
  std::vector<std::string> cameras;
  int width = 640, height = 480;
  std::vector<DatasetEpisode> episodes;
};

/// Of version 3.0 all episodes are in one file, rows as images.
void write_dataset(const std::filesystem::path& folder, const DatasetFields& fields);

/// Where a camera's video of an episode belongs.
[[nodiscard]] std::filesystem::path video_of_dataset(const std::filesystem::path& folder,
                                                     const DatasetFields& fields,
                                                     const std::string& camera, int episode);

}  // namespace kinescope::truth
