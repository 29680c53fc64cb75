// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/video_file.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <utility>
#include <vector>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
}

#include <fmt/format.h>

#include "calib/vision/av_frame.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

// FFmpeg 6.1 moved these.
const std::int32_t* display_matrix(const AVStream& stream) {
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(60, 31, 100)
  const AVPacketSideData* side =
      av_packet_side_data_get(stream.codecpar->coded_side_data, stream.codecpar->nb_coded_side_data,
                              AV_PKT_DATA_DISPLAYMATRIX);
  return side == nullptr ? nullptr : reinterpret_cast<const std::int32_t*>(side->data);
#else
  return reinterpret_cast<const std::int32_t*>(
      av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr));
#endif
}

bool is_key(const AVFrame& frame) {
#ifdef AV_FRAME_FLAG_KEY
  return (frame.flags & AV_FRAME_FLAG_KEY) != 0;
#else
  return frame.key_frame != 0;
#endif
}

constexpr double kHalfTick = 0.5;
constexpr double kLeastTicks = 4.0;  // a frame, for its stamp's rounding to be seen as such

// Turns by quarter turns, counterclockwise as the display matrix counts.
GreyImage turned(GreyImage in, int quarters) {
  if (quarters == 0) return in;
  const bool swap = quarters % 2 == 1;
  GreyImage out{swap ? in.height : in.width, swap ? in.width : in.height, {}};
  out.pixels.resize(in.pixels.size());
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      int sx = x;
      int sy = y;
      if (quarters == 1) sx = in.width - 1 - y, sy = x;
      if (quarters == 2) sx = in.width - 1 - x, sy = in.height - 1 - y;
      if (quarters == 3) sx = y, sy = in.height - 1 - x;
      out.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(out.width) +
                 static_cast<std::size_t>(x)] =
          in.pixels[static_cast<std::size_t>(sy) * static_cast<std::size_t>(in.width) +
                    static_cast<std::size_t>(sx)];
    }
  }
  return out;
}

class VideoFileReader final : public VideoReader {
 public:
  VideoFileReader(const std::filesystem::path& path, double from_s) : path_(path.string()) {
    av_log_set_level(AV_LOG_QUIET);
    check_readable(path);
    open_container();
    open_decoder();
    fill_info();
    if (from_s > 0.0) in_the_middle_ = go_to(from_s);
    first_ = decode_next();
    if (!first_) {
      throw bad_input(path_, "no frame of the video can be decoded",
                      "the file is damaged or cut off; copy it again from the camera");
    }
  }

  const VideoInfo& info() const override { return info_; }
  const std::vector<std::string>& warnings() const override { return warnings_; }

  std::optional<VideoFrame> next() override {
    if (first_) return std::exchange(first_, std::nullopt);
    if (finished_) return std::nullopt;
    std::optional<VideoFrame> frame = decode_next();
    if (!frame) finish();
    return frame;
  }

  // Frames that come once more because the key frame lies behind have no stamp after the last one.
  void skip_to(double time_s) override {
    constexpr double kFar_s = 10.0;  // about what lies between the key frames of usual encoders
    // Frames shown before a key frame and stored behind it need those of the key frame before: at
    // most so many (H.264: max_num_reorder_frames), however rarely they come.
    constexpr double kReordered = 16.0;
    constexpr double kLeast_s = 1.0;  // chosen: where frames come less evenly than they are stamped
    const double lead_s = std::max(kLeast_s, kReordered * step_s_);
    if (finished_ || drained_ || time_s < last_time_ + kFar_s || !go_to(time_s - lead_s)) return;
    avcodec_flush_buffers(decoder_.get());
    in_the_middle_ = true;
    first_.reset();
  }

 private:
  void check_readable(const std::filesystem::path& path) const {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) {
      throw bad_input(path_, "not a file", "name a video file or a folder of images");
    }
    if (std::filesystem::file_size(path, error) == 0) {
      throw bad_input(path_, "the video is empty", "copy it again from the camera");
    }
  }

  void open_container() {
    AVFormatContext* raw = nullptr;
    AVDictionary* settings = nullptr;
    av_dict_set(&settings, "protocol_whitelist", "file",
                0);  // a playlist must not reach the network
    // "file:" keeps FFmpeg from reading a colon in the name as a protocol.
    const int status = avformat_open_input(&raw, ("file:" + path_).c_str(), nullptr, &settings);
    av_dict_free(&settings);
    if (status == AVERROR(EACCES) || status == AVERROR(EPERM)) {
      throw bad_input(path_, "may not be read", "check its permissions");
    }
    if (status < 0) {
      throw bad_input(path_,
                      "not a video that can be read, or one that is cut off before its index",
                      "mp4, avi and mkv are read; a camera that lost power may have left an mp4 "
                      "without an index");
    }
    container_.reset(raw);
    // Text files pass as subtitles or "tty" animations.
    const std::string_view format = container_->iformat->name;
    const bool is_text = format == "tty" || format == "srt" || format == "ass";
    if (is_text || avformat_find_stream_info(raw, nullptr) < 0) {
      throw bad_input(path_, "not a video", "mp4, avi and mkv are read");
    }
    stream_ = av_find_best_stream(raw, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
    if (stream_ < 0) throw bad_input(path_, "holds no video stream", "name the video file");
  }

  void open_decoder() {
    const AVCodecParameters* parameters = stream().codecpar;
    const AVCodec* codec = avcodec_find_decoder(parameters->codec_id);
    if (codec == nullptr) {
      throw bad_input(path_,
                      fmt::format("no decoder for {}", avcodec_get_name(parameters->codec_id)),
                      "convert the video to H.264");
    }
    decoder_.reset(avcodec_alloc_context3(codec));
    decoder_->thread_count = 1;  // frames are the unit of parallel work; damage shows in one place
    decoder_->pkt_timebase = stream().time_base;
    if (avcodec_parameters_to_context(decoder_.get(), parameters) < 0 ||
        avcodec_open2(decoder_.get(), codec, nullptr) < 0) {
      throw bad_input(path_, "the video's decoder does not start", "convert the video to H.264");
    }
    packet_.reset(av_packet_alloc());
    frame_.reset(av_frame_alloc());
  }

  void fill_info() {
    const AVStream& s = stream();
    info_.codec = avcodec_get_name(s.codecpar->codec_id);
    info_.frame_count = static_cast<int>(s.nb_frames);
    if (s.duration != AV_NOPTS_VALUE) {
      info_.duration_s = static_cast<double>(s.duration) * av_q2d(s.time_base);
    } else if (container_->duration != AV_NOPTS_VALUE) {
      info_.duration_s = static_cast<double>(container_->duration) / AV_TIME_BASE;
    }
    if (container_->start_time != AV_NOPTS_VALUE) {
      start_s_ = static_cast<double>(container_->start_time) / AV_TIME_BASE;
    }
    // Matroska gives the last stamp for its length.
    if (std::string_view(container_->iformat->name).starts_with("matroska"))
      info_.duration_s = std::max(0.0, info_.duration_s - start_s_);
    const double rate = av_q2d(s.r_frame_rate);
    if (rate > 0.0 && 1.0 / rate >= kLeastTicks * av_q2d(s.time_base)) step_s_ = 1.0 / rate;
    if (const std::int32_t* matrix = display_matrix(s)) {
      const double angle = av_display_rotation_get(matrix);  // degrees counterclockwise
      if (std::isfinite(angle)) {
        quarters_ = ((static_cast<int>(std::lround(angle / 90.0)) % 4) + 4) % 4;
      }
    }
  }

  // Where it cannot go there, reading goes on where it is.
  bool go_to(double from_s) {
    const double tick = av_q2d(stream().time_base);
    const auto stamp = static_cast<std::int64_t>(std::floor((from_s + kHalfTick * tick) / tick));
    return av_seek_frame(container_.get(), stream_, stamp, AVSEEK_FLAG_BACKWARD) >= 0;
  }

  [[nodiscard]] const AVStream& stream() const {
    return *container_->streams[static_cast<unsigned>(stream_)];
  }

  // The next undamaged frame with a stamp after its predecessor's.
  std::optional<VideoFrame> decode_next() {
    while (receive()) {
      const bool damaged =
          (frame_->flags & AV_FRAME_FLAG_CORRUPT) != 0 || frame_->decode_error_flags != 0;
      if (damaged) after_damage_ = true;
      if (!damaged && is_key(*frame_)) after_damage_ = false;
      if (after_damage_) {
        ++damaged_;
        continue;
      }
      const std::optional<double> time = stamp();
      if (!time) continue;
      if (index_ > 0) steps_.push_back(*time - last_time_);
      last_time_ = *time;
      VideoFrame out{index_++, *time, grey()};
      if (!size_known_) {
        info_.width = out.image.width;  // as decoded and turned upright
        info_.height = out.image.height;
      }
      if (size_known_ && (out.image.width != info_.width || out.image.height != info_.height)) {
        warnings_.push_back(fmt::format(
            "{}: the picture changes its size at {:.3f} s; reading stops", path_, *time));
        finished_ = true;
        return std::nullopt;
      }
      size_known_ = true;
      return out;
    }
    return std::nullopt;
  }

  // Feeds packets until a frame comes out. False at the end.
  bool receive() {
    while (true) {
      const int status = avcodec_receive_frame(decoder_.get(), frame_.get());
      if (status == 0) return true;
      if (status == AVERROR_EOF) return false;
      if (status != AVERROR(EAGAIN)) {
        if (drained_) return false;
        after_damage_ = true;
        ++damaged_;
      }
      feed();
    }
  }

  void feed() {
    if (drained_) return;
    int status = av_read_frame(container_.get(), packet_.get());
    while (status >= 0 && packet_->stream_index != stream_) {
      av_packet_unref(packet_.get());
      status = av_read_frame(container_.get(), packet_.get());
    }
    if (status < 0) {
      if (status != AVERROR_EOF) read_error_ = true;
      drained_ = true;
      avcodec_send_packet(decoder_.get(), nullptr);
      return;
    }
    ++packets_;
    if ((packet_->flags & AV_PKT_FLAG_CORRUPT) != 0) {  // cut off inside the packet
      read_error_ = true;
    } else if (avcodec_send_packet(decoder_.get(), packet_.get()) < 0) {
      after_damage_ = true;
      ++damaged_;
    }
    av_packet_unref(packet_.get());
  }

  std::optional<double> stamp() {
    const double unit = av_q2d(stream().time_base);
    if (frame_->best_effort_timestamp == AV_NOPTS_VALUE) {
      ++unstamped_;
      return std::nullopt;
    }
    const double time = unrounded(static_cast<double>(frame_->best_effort_timestamp) * unit, unit);
    if (index_ > 0 && !(time > last_time_)) {
      ++unordered_;
      return std::nullopt;
    }
    return time;
  }

  // Containers round stamps to their ticks (Matroska: 1 ms), half a pixel of what moves fast. A
  // stamp within a tick of the stream's even frames is that frame's.
  [[nodiscard]] double unrounded(double time, double tick) {
    if (!first_time_) first_time_ = time;
    if (!(step_s_ > 0.0)) return time;
    const double even = *first_time_ + std::round((time - *first_time_) / step_s_) * step_s_;
    return std::abs(time - even) <= tick ? even : time;
  }

  GreyImage grey() { return turned(grey_of(*frame_, scaler_, path_), quarters_); }

  double median_step() const { return median_of(steps_); }

  void finish() {
    finished_ = true;
    if (damaged_ > 0) {
      warnings_.push_back(
          fmt::format("{}: {} damaged frames are left out (a damaged frame spoils those up to the "
                      "next key frame)",
                      path_, damaged_));
    }
    if (unstamped_ > 0) {
      warnings_.push_back(
          fmt::format("{}: {} frames carry no time stamp and are left out", path_, unstamped_));
    }
    if (unordered_ > 0) {
      warnings_.push_back(
          fmt::format("{}: the stamps of {} frames do not increase; these frames are left out",
                      path_, unordered_));
    }
    const double step = median_step();
    const double end = start_s_ + info_.duration_s;
    constexpr double kSteps = 4.0;
    const bool short_of_time =
        info_.duration_s > 0.0 && step > 0.0 && last_time_ + kSteps * step < end;
    const bool short_of_packets =
        !in_the_middle_ && info_.frame_count > 0 && packets_ < info_.frame_count;
    const auto gaps = std::ranges::count_if(steps_, [&](double s) { return s > kSteps * step; });
    if (gaps > 0) {
      warnings_.push_back(fmt::format("{}: {} gaps between frames, the longest of {:.3f} s", path_,
                                      gaps, std::ranges::max(steps_)));
    }
    if (read_error_ || short_of_packets || short_of_time) {
      const std::string whole =
          info_.frame_count > 0 ? fmt::format(" of {}", info_.frame_count) : std::string();
      warnings_.push_back(
          fmt::format("{}: the file ends early, after {:.3f} s: {}{} frames are used", path_,
                      last_time_, index_, whole));
    }
  }

  std::string path_;
  Av<AVFormatContext> container_;
  Av<AVCodecContext> decoder_;
  Av<AVPacket> packet_;
  Av<AVFrame> frame_;
  Av<SwsContext> scaler_;
  int stream_ = -1;
  int quarters_ = 0;
  VideoInfo info_;
  std::vector<std::string> warnings_;
  std::optional<VideoFrame> first_;
  bool size_known_ = false;
  bool drained_ = false;
  bool finished_ = false;
  bool read_error_ = false;
  bool in_the_middle_ = false;  // of the file reading began
  bool after_damage_ = false;
  int packets_ = 0;
  int index_ = 0;
  int damaged_ = 0;
  int unstamped_ = 0;
  int unordered_ = 0;
  double last_time_ = 0.0;
  double start_s_ = 0.0;  // stamp of the container's beginning
  double step_s_ = 0.0;   // between even frames; 0: not known, or as fine as the ticks
  std::optional<double> first_time_;
  std::vector<double> steps_;  // between frames, s
};

}  // namespace

std::unique_ptr<VideoReader> open_video_file(const std::filesystem::path& path, double from_s) {
  return std::make_unique<VideoFileReader>(path, from_s);
}

}  // namespace kinescope
