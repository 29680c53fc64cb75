// SPDX-License-Identifier: Apache-2.0
//
// What a capture knows, as a value and as JSON: for its page while it goes on, and for `--json`.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/capture/guide.h"

namespace kinescope {

struct CaptureStatus {
  std::string source;  ///< without a password
  std::string folder;
  std::string family;
  std::string stamps;             ///< of the frames: "driver", "source", "arrival"
  std::string joint_stamps;       ///< "sender", "reception"; empty: no joint values
  std::string phase = "waiting";  ///< then "recording", "ended"
  std::string end;                ///< why it ended
  int recorded = 0;               ///< frames
  double seconds = 0.0;           ///< of the recording
  CaptureGuide guide;             ///< of the recording; before it, of what was seen
  std::vector<std::string> missing;
  std::vector<std::string> warnings;
};

[[nodiscard]] nlohmann::json capture_json(const CaptureStatus& status);
/// The same with the last frame that was looked at.
[[nodiscard]] nlohmann::json live_json(const CaptureStatus& status, const FrameView& now);

}  // namespace kinescope
