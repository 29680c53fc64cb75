// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/live_camera.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <thread>
#include <utility>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <unistd.h>

#include "calib/vision/video.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

enum class SourceKind { kDevice, kStream, kFile };

constexpr const char* kDeviceFolder = "/dev/video";

struct NamedSource {
  SourceKind kind = SourceKind::kFile;
  std::string name;
};

NamedSource named_source(const std::string& source) {
  const bool number =
      !source.empty() && source.find_first_not_of("0123456789") == std::string::npos;
  if (number) return {SourceKind::kDevice, kDeviceFolder + source};
  if (source.starts_with(kDeviceFolder)) return {SourceKind::kDevice, source};
  if (source.find("://") != std::string::npos) return {SourceKind::kStream, source};
  return {SourceKind::kFile, source};
}

void require_device(const std::string& device) {
  std::error_code error;
  if (!fs::exists(device, error)) {
    throw bad_input(device, "no such camera",
                    "is it plugged in? ls /dev/video* shows those that are");
  }
  if (::access(device.c_str(), R_OK | W_OK) != 0) {
    throw bad_input(device, "the camera may not be opened",
                    "add yourself to the group video, and log in again");
  }
}

void require_file(const std::string& file) {
  std::error_code error;
  if (fs::is_regular_file(file, error)) return;
  throw bad_input(file, "no such camera, stream or file",
                  "name a device (/dev/video0), a URL (rtsp://..) or a video file");
}

// Stamps that are off the arrival by more are of another clock, or of none.
constexpr double kSameClock_s = 1.0;

/// A file at its own speed. OpenCV's reader gives the last frames no stamps.
class Film final : public LiveCamera {
 public:
  explicit Film(const std::string& file) : video_(open_video(file)) {}

  std::optional<LiveFrame> next() override {
    std::optional<VideoFrame> frame = video_->next();
    if (!frame) return std::nullopt;
    if (!begin_s_) begin_s_ = monotonic_s() - frame->time_s;
    const double due_s = *begin_s_ + frame->time_s;
    std::this_thread::sleep_for(std::chrono::duration<double>(due_s - monotonic_s()));
    return LiveFrame{due_s, std::move(frame->image)};
  }
  std::string stamps() const override { return "source"; }

 private:
  std::unique_ptr<VideoReader> video_;
  std::optional<double> begin_s_;  // of the film, on our clock
};

class OpenCvCamera final : public LiveCamera {
 public:
  explicit OpenCvCamera(const NamedSource& source) : source_(source) {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    // OpenCV lets FFmpeg's errors through, with addresses in them; -8 is AV_LOG_QUIET.
    ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
    open();
    first_ = grab();
    if (!first_) {
      throw bad_input(without_password(source_.name), "no picture comes from it",
                      source_.kind == SourceKind::kDevice ? "is another program using the camera?"
                                                          : "does a player (ffplay) show it?");
    }
  }

  std::optional<LiveFrame> next() override {
    if (first_) return std::exchange(first_, std::nullopt);
    return grab();
  }

  std::string stamps() const override {
    if (!own_stamps_) return "arrival";
    return source_.kind == SourceKind::kDevice ? "driver" : "source";
  }

 private:
  void open() {
    // A stream that is silent must not hold the end of a recording up.
    constexpr int kOpen_ms = 10'000;
    constexpr int kRead_ms = 5'000;
    const bool device = source_.kind == SourceKind::kDevice;
    try {
      if (device) {
        require_device(source_.name);
        capture_.open(source_.name, cv::CAP_V4L2);
      } else {
        capture_.open(
            source_.name, cv::CAP_FFMPEG,
            {cv::CAP_PROP_OPEN_TIMEOUT_MSEC, kOpen_ms, cv::CAP_PROP_READ_TIMEOUT_MSEC, kRead_ms});
      }
    } catch (const cv::Exception&) {
      capture_.release();
    }
    // What a web camera sends over HTTP has no stamps; FFmpeg makes some up.
    own_stamps_ = device || source_.name.starts_with("rtsp");
  }

  std::optional<LiveFrame> grab() {
    cv::Mat picture;
    std::optional<double> stamp_s;
    while (!stamp_s) {
      try {
        if (!capture_.isOpened() || !capture_.read(picture) || picture.empty()) return std::nullopt;
      } catch (const cv::Exception&) {
        return std::nullopt;
      }
      stamp_s = stamp(1e-3 * capture_.get(cv::CAP_PROP_POS_MSEC));
    }
    cv::Mat grey = picture;
    if (picture.channels() == 3) cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
    if (grey.type() != CV_8UC1) return std::nullopt;
    return LiveFrame{*stamp_s,
                     copy_of({grey.data, grey.cols, grey.rows, static_cast<int>(grey.step)})};
  }

  // Nothing of a frame that the source gave no stamp.
  std::optional<double> stamp(double source_s) {
    const double now_s = monotonic_s();
    if (!begin_s_) begin_s_ = source_.kind == SourceKind::kDevice ? 0.0 : now_s - source_s;
    const double own_s = *begin_s_ + source_s;
    if (own_stamps_ && std::abs(own_s - now_s) > kSameClock_s) own_stamps_ = false;
    const double out = own_stamps_ ? own_s : now_s;
    if (out <= last_s_) return std::nullopt;
    last_s_ = out;
    return out;
  }

  NamedSource source_;
  cv::VideoCapture capture_;
  bool own_stamps_ = true;
  std::optional<double> begin_s_;  // of the source's clock, on ours
  double last_s_ = 0.0;
  std::optional<LiveFrame> first_;
};

}  // namespace

double monotonic_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::unique_ptr<LiveCamera> open_live_camera(const std::string& source) {
  const NamedSource named = named_source(source);
  if (named.kind != SourceKind::kFile) return std::make_unique<OpenCvCamera>(named);
  require_file(named.name);
  return std::make_unique<Film>(named.name);
}

std::string without_password(const std::string& source) {
  const std::size_t scheme = source.find("://");
  if (scheme == std::string::npos) return source;
  const std::size_t begin = scheme + 3;
  const std::size_t at = source.substr(0, source.find('/', begin)).rfind('@');
  return at == std::string::npos || at < begin ? source
                                               : source.substr(0, begin) + source.substr(at + 1);
}

std::vector<std::uint8_t> jpeg_of(const ImageView& image, int quality) {
  // OpenCV's matrices do not know const; it is only read.
  const cv::Mat picture(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.data),
                        static_cast<std::size_t>(image.stride));
  std::vector<std::uint8_t> out;
  KINESCOPE_CHECK(cv::imencode(".jpg", picture, out, {cv::IMWRITE_JPEG_QUALITY, quality}),
                  "a grey image as JPEG");
  return out;
}

}  // namespace kinescope
