// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/stills.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/vision/video.h"

extern "C" {
#include <libavutil/base64.h>
}

namespace kinescope {
namespace {

std::string base64_of(const std::vector<std::uint8_t>& bytes) {
  std::string out(AV_BASE64_SIZE(bytes.size()), '\0');
  av_base64_encode(out.data(), static_cast<int>(out.size()), bytes.data(),
                   static_cast<int>(bytes.size()));
  out.pop_back();  // the terminating zero
  return out;
}

std::string picture_of(const GreyImage& image, int width) {
  constexpr int kQuality = 60;  // of 100: markers stay readable, a frame takes about 15 kB
  const cv::Mat whole(image.height, image.width, CV_8UC1,
                      const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat small = whole;
  if (image.width > width) {
    const double scale = static_cast<double>(width) / image.width;
    cv::resize(whole, small,
               {width, std::max(1, static_cast<int>(std::lround(scale * image.height)))}, 0.0, 0.0,
               cv::INTER_AREA);
  }
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return base64_of(bytes);
}

}  // namespace

std::vector<Still> stills_at(const std::filesystem::path& video, const std::vector<double>& times_s,
                             int width) {
  constexpr double kSameFrame = 1e-4;  // s: what rounding leaves, far below a frame
  std::vector<Still> out;
  const auto reader = open_video(video);
  std::size_t next = 0;
  while (next < times_s.size()) {
    reader->skip_to(times_s[next]);
    const std::optional<VideoFrame> frame = reader->next();
    if (!frame) break;
    while (next < times_s.size() && times_s[next] < frame->time_s - kSameFrame) ++next;
    if (next == times_s.size() || times_s[next] > frame->time_s + kSameFrame) continue;
    out.push_back({times_s[next++], frame->image.width, frame->image.height,
                   picture_of(frame->image, width)});
  }
  return out;
}

}  // namespace kinescope
