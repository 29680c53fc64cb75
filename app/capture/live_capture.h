// SPDX-License-Identifier: Apache-2.0
//
// Takes   a camera that runs and, where there are any, joint values.
// Gives   a recording's folder, with a page that guides whoever makes it, or without.
// Method  this thread records every frame; another looks for markers in the newest one, as often as
//         it can; a third stamps joint values. The page's buttons and signals only set flags.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "app/capture/capture_json.h"
#include "app/capture/guide.h"
#include "app/capture/recorder.h"
#include "kinematics/core/error.h"

namespace kinescope {

struct CaptureRequest {
  std::string source;
  std::filesystem::path folder;
  RecordingHead head;
  bool find_family = false;           ///< where no marker of head.markers.family is seen
  std::optional<std::string> joints;  ///< "-", a pipe or a file
  std::optional<int> port;            ///< of the page, 0: any; nothing: no page, begins at once
  std::optional<double> seconds;      ///< longest duration of the recording
};

/// All that the outside has a say in while it goes on; each may be empty.
struct CaptureCalls {
  std::function<bool()> interrupted;                     ///< asked at every frame
  std::function<void(const std::string& url)> page;      ///< when it is there
  std::function<void(const std::string& text)> warning;  ///< each once
  std::function<void(double seconds)> recorded;          ///< so far
};

struct CaptureOutcome {
  CaptureStatus status;
  std::optional<Error> failed;  ///< the folder could not be written any more
};

/// Throws bad_input: no such source, no such joint values; bad_request: the port is in use, the
/// folder cannot be written at all. What was recorded before anything else goes wrong is kept.
[[nodiscard]] CaptureOutcome capture(const CaptureRequest& request, const CaptureCalls& calls);

}  // namespace kinescope
