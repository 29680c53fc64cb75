// SPDX-License-Identifier: Apache-2.0
//
// Grey frames to an H.264 file, through the ffmpeg program.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <vector>

namespace kinescope::truth {

class H264Writer {
 public:
  /// `crf`: of H.264, less is better. Throws std::runtime_error where ffmpeg cannot be started.
  H264Writer(const std::filesystem::path& file, int width, int height, double frame_rate_hz,
             int crf);
  /// `grey`: width x height, row by row.
  void add(const std::vector<std::uint8_t>& grey);
  /// Throws std::runtime_error where ffmpeg has failed.
  void finish();

 private:
  struct Close {
    void operator()(std::FILE* pipe) const { static_cast<void>(pclose(pipe)); }
  };
  std::filesystem::path file_;
  std::unique_ptr<std::FILE, Close> pipe_;
};

}  // namespace kinescope::truth
