// SPDX-License-Identifier: Apache-2.0
//
// Which files a recording consists of. Only bags and datasets
// are opened here.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/io/recording.h"

namespace kinescope {

/// The files of one of several cameras.
struct CameraFiles {
  std::string name;
  std::optional<std::filesystem::path> video, corners, camera;
};

struct RecordingFiles {
  std::filesystem::path folder;  ///< the recording's, or that of its bag
  RecordingEntry entry = RecordingEntry::kVideo;
  std::optional<std::filesystem::path> video, joints, camera, tags, settings, corners, poses,
      points, nominal, flange;
  std::vector<CameraFiles> cameras;   ///< by name; then none of video, corners and camera
  std::vector<std::string> warnings;  ///< files that are there and not used

  /// All of them, sorted; a folder of images or of a bag as its files.
  [[nodiscard]] std::vector<std::filesystem::path> all() const;
};

/// Throws bad_input: no such folder, two videos of one camera, a named file that is not there,
/// nothing that shows the robot, two videos. Throws bad_request when the command line names two of
/// --video, --corners, --poses,
/// --points.
[[nodiscard]] RecordingFiles find_recording_files(const RecordingPaths& paths);

}  // namespace kinescope
