// SPDX-License-Identifier: Apache-2.0
//
// Takes   a camera that runs: a V4L2 device, a stream, or a video file played at its own speed.
// Gives   grey frames as they come, stamped on the computer's monotonic clock, s (monotonic_s()).
// Method  OpenCV's VideoCapture; of files video.h. Stamps: of a device its driver's, which are of
// that
//         clock; of rtsp and of a file those of the source, begun when its first frame came; else,
//         and where those go another way than the clock, the arrival's.
// Not here: reading what was recorded (video.h), whose stamps must be exact.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/vision/image_view.h"

namespace kinescope {

/// CLOCK_MONOTONIC, s.
[[nodiscard]] double monotonic_s();

struct LiveFrame {
  double stamp_s = 0.0;  ///< increasing
  GreyImage image;
};

class LiveCamera {
 public:
  virtual ~LiveCamera() = default;
  /// Waits for the next frame; nothing where no more come (the end, the camera unplugged).
  [[nodiscard]] virtual std::optional<LiveFrame> next() = 0;
  /// What the stamps are: "driver", "source" or "arrival".
  [[nodiscard]] virtual std::string stamps() const = 0;
};

/// `source`: "0" or "/dev/video0", a URL, or a file. Throws bad_input where nothing comes from it.
[[nodiscard]] std::unique_ptr<LiveCamera> open_live_camera(const std::string& source);

/// A URL without the password in it; anything else as it is.
[[nodiscard]] std::string without_password(const std::string& source);

/// The image as JPEG; `quality` up to 100.
[[nodiscard]] std::vector<std::uint8_t> jpeg_of(const ImageView& image, int quality);

}  // namespace kinescope
