// SPDX-License-Identifier: Apache-2.0
//
// Several cameras of one bag or dataset, named on the command line behind it with commas between
// them: "rig.mcap:/left/image_raw,/right/image_raw", "so101:observation.images.top,
// observation.images.side:0-9" (without the blank).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "app/io/recording_files.h"
#include "kinematics/recorded/container.h"

namespace kinescope {

/// A path for each part that is named; the path itself where that is one, or none. Throws
/// bad_input where nothing stands between two commas.
[[nodiscard]] std::vector<std::filesystem::path> parts_apart(const std::filesystem::path& path);

/// What tells the parts apart, as names: of "/left/image_raw" and "/right/image_raw" left and
/// right; "camera1", .. where nothing does.
[[nodiscard]] std::vector<std::string> names_of_parts(const std::vector<std::string>& parts);

/// Puts the cameras into `files`, by name, with its entry: images, or detections of markers. Their
/// intrinsics are camera_NAME.yaml in one of the folders, else those that the bag published. Throws
/// bad_input naming the part: not there, of another kind, named twice.
void take_cameras(const std::vector<std::filesystem::path>& parts,
                  const std::vector<std::filesystem::path>& folders, RecordingFiles& files);

}  // namespace kinescope
