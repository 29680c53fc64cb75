// SPDX-License-Identifier: Apache-2.0
//
// Takes   a video file (mp4, avi, mkv, ..), a folder of images with a time-stamp CSV, a bag, or
//         a LeRobot dataset.
// Gives   grey frames one by one with their times, s, from the container (never from frame rate x
// index). Not here: detection.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "calib/vision/image_view.h"

namespace kinescope {

struct VideoInfo {
  int width = 0;
  int height = 0;
  int frame_count = 0;      ///< as the container says; 0 where it does not
  double duration_s = 0.0;  ///< as the container says; 0 where it does not
  std::string codec;
};

struct VideoFrame {
  int index = 0;        ///< from 0
  double time_s = 0.0;  ///< presentation time in the container; the first frame of a video file is
                        ///< at its own stamp
  GreyImage image;
};

/// Reads frames in order. Throws bad_input when the source is missing, empty, holds no video stream
/// or nothing can be decoded.
class VideoReader {
 public:
  virtual ~VideoReader() = default;
  [[nodiscard]] virtual const VideoInfo& info() const = 0;
  /// The next frame, or nothing at the end (or where the file is cut off).
  [[nodiscard]] virtual std::optional<VideoFrame> next() = 0;
  /// May go on at a later frame, none after `time_s`, where that is far ahead: frames are no longer
  /// counted from the first one then.
  virtual void skip_to(double time_s) { static_cast<void>(time_s); }
  /// What was wrong on the way, one line each: frames that do not decode, a file that ends early,
  /// stamps that do not increase.
  [[nodiscard]] virtual const std::vector<std::string>& warnings() const = 0;
};

/// Opens a video file, or a folder of images (png, jpg, ..; in the order of their times, from
/// `times.csv` with columns image,t in it or beside it). Pictures that the container declares as
/// turned are turned upright. Or the images of a bag (bag_video.h), "FILE" or "FILE:/topic", or of
/// a LeRobot dataset (dataset_video.h), "FOLDER" or "FOLDER:camera".
[[nodiscard]] std::unique_ptr<VideoReader> open_video(const std::filesystem::path& path);

}  // namespace kinescope
