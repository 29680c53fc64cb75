// SPDX-License-Identifier: Apache-2.0
//
// `kinescope capture` as a function.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "app/commands/commands.h"

namespace kinescope {

struct CaptureOptions {
  std::string source;                           ///< "0", "/dev/video0", a URL or a file
  std::filesystem::path output;                 ///< the recording's folder
  std::optional<std::string> family;            ///< default: that of the markers that are seen
  std::optional<double> size_m;                 ///< of all markers
  std::optional<std::filesystem::path> tags;    ///< in place of both; default: the folder's
  std::optional<std::filesystem::path> camera;  ///< default: the folder's
  std::optional<std::string> joints;            ///< "-", a pipe or a file that grows
  std::optional<double> seconds;                ///< longest duration
  bool no_page = false;
  int port = 0;  ///< of the page; 0: any
  bool force = false;
};

/// Ends on Ctrl-C, too. kUndetermined where nothing was recorded, or no marker was seen; throws as
/// capture() in app/capture/live_capture.h does.
[[nodiscard]] ExitCode capture_command(const CaptureOptions& options, const Console& console);

}  // namespace kinescope
