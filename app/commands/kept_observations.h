// SPDX-License-Identifier: Apache-2.0
//
// What was detected of a recording's markers, kept so that it is not done twice:
// observations_NAME.csv is what was seen, observations_NAME.json what that was detected from and
// with.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/io/recording.h"
#include "app/report/run_summary.h"
#include "calib/camera/tag_observations.h"
#include "calib/vision/detect.h"

namespace kinescope {

/// The names of both files; of a recording without a name of its own (one camera) without it.
[[nodiscard]] std::vector<std::string> observations_files(const std::string& camera);

/// Names and contents of the files; of a recording that holds no video the table alone, and nothing
/// where nothing was seen.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> kept_observations(
    const Recording& recording, const TagObservations& observations, const DetectOptions& detect);

/// Those in the folder, to the last bit as they were detected; nothing where there are none of this
/// video with these markers and options by this version, or they are damaged.
[[nodiscard]] std::optional<TagObservations> read_kept_observations(
    const std::filesystem::path& folder, const Recording& recording, const DetectOptions& detect);

/// Every file that was read, with its SHA-256.
[[nodiscard]] std::vector<InputFile> hash_inputs(const Recording& recording);

}  // namespace kinescope
