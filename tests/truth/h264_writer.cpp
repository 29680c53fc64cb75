// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/h264_writer.h"

#include <stdexcept>
#include <string>

#include <fmt/format.h>

namespace kinescope::truth {

H264Writer::H264Writer(const std::filesystem::path& file, int width, int height,
                       double frame_rate_hz, int crf)
    : file_(file) {
  const std::string command = fmt::format(
      "ffmpeg -y -v error -f rawvideo -pix_fmt gray -s {}x{} -r {} -i - -c:v libx264 -crf {} "
      "-pix_fmt yuv420p '{}'",
      width, height, frame_rate_hz, crf, file.string());
  pipe_.reset(popen(command.c_str(), "w"));  // NOLINT(cert-env33-c): its own arguments only
  if (!pipe_) throw std::runtime_error("cannot start ffmpeg");
}

void H264Writer::add(const std::vector<std::uint8_t>& grey) {
  if (std::fwrite(grey.data(), 1, grey.size(), pipe_.get()) != grey.size())
    throw std::runtime_error("ffmpeg does not take the frames: is it installed?");
}

void H264Writer::finish() {
  if (pclose(pipe_.release()) != 0)
    throw std::runtime_error("ffmpeg cannot write " + file_.string());
}

}  // namespace kinescope::truth
