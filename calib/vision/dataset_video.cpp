// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/dataset_video.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "calib/vision/video_file.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

/// An episode's frames in a file.
struct VideoOfEpisode {
  std::size_t episode = 0;
  fs::path file;
  double from_s = 0.0;   ///< in the file
  double start_s = 0.0;  ///< on the log's clock
  std::size_t frames = 0;
};

std::vector<VideoOfEpisode> parts_of(const datasets::Dataset& dataset,
                                     const datasets::Source& source, const std::string& camera) {
  const datasets::Joined joined = datasets::choose_episodes(dataset, source);
  std::vector<VideoOfEpisode> out;
  for (std::size_t i = 0; i < joined.episodes.size(); ++i) {
    const datasets::Episode& episode = *joined.episodes[i];
    const auto video = episode.videos.find(camera);
    const std::string place = fmt::format("{}: episode {}", dataset.folder.string(), episode.index);
    const char* remedy = "copy the dataset again with its videos, or name other episodes";
    if (video == episode.videos.end())
      throw bad_input(place, fmt::format("lists no video of {}", camera), remedy);
    std::error_code error;
    if (!fs::exists(video->second.file, error))
      throw bad_input(video->second.file.string(), "no such video", remedy);
    out.push_back({episode.index, video->second.file, video->second.from_s, joined.starts_s[i],
                   episode.frames});
  }
  return out;
}

/// What VideoInfo can count.
constexpr std::size_t kMostFrames = std::numeric_limits<int>::max();
/// A frame that is this much of a step before a stamp is at it: stamps are rounded.
constexpr double kHalfStep = 0.5;

class DatasetVideoReader final : public VideoReader {
 public:
  DatasetVideoReader(const datasets::Dataset& dataset, const datasets::Feature& camera,
                     std::vector<VideoOfEpisode> parts)
      : name_(dataset.folder.string() + ":" + camera.name),
        step_s_(1.0 / dataset.frame_rate_hz),
        parts_(std::move(parts)) {
    open(parts_.front());
    info_ = reader_->info();
    std::size_t frames = 0;
    for (const VideoOfEpisode& part : parts_) frames += part.frames;
    info_.frame_count = static_cast<int>(std::min(frames, kMostFrames));
    info_.duration_s = parts_.back().start_s + step_s_ * static_cast<double>(parts_.back().frames);
    warn_of_size(camera);
  }

  const VideoInfo& info() const override { return info_; }
  const std::vector<std::string>& warnings() const override { return warnings_; }

  std::optional<VideoFrame> next() override {
    while (part_ < parts_.size()) {
      if (std::optional<VideoFrame> frame = next_of(parts_[part_])) return frame;
      warn_of_frames(parts_[part_]);
      if (size_changed_) break;
      shown_ = 0;
      if (++part_ < parts_.size()) go_to(parts_[part_]);
    }
    part_ = parts_.size();
    return std::nullopt;
  }

 private:
  void open(const VideoOfEpisode& part) {
    take_warnings();
    reader_ = open_video_file(part.file, part.from_s);
    file_ = part.file;
    ahead_.reset();
    last_s_ = -1.0;
  }

  /// Goes on in the file that is open where the part lies further on in it.
  void go_to(const VideoOfEpisode& part) {
    constexpr double kNear = 2.0;  // s that are sooner decoded than sought
    const bool further = part.file == file_ && part.from_s > last_s_ - kHalfStep * step_s_ &&
                         part.from_s < last_s_ + kNear;
    if (!further) open(part);
  }

  std::optional<VideoFrame> next_of(const VideoOfEpisode& part) {
    const double first_s = part.from_s - kHalfStep * step_s_;
    const double end_s = first_s + step_s_ * static_cast<double>(part.frames);
    while (true) {
      std::optional<VideoFrame> frame =
          ahead_ ? std::exchange(ahead_, std::nullopt) : reader_->next();
      if (!frame) return std::nullopt;
      last_s_ = frame->time_s;
      if (frame->time_s < first_s) continue;
      if (frame->time_s >= end_s) {
        ahead_ = std::move(frame);
        return std::nullopt;
      }
      size_changed_ = frame->image.width != info_.width || frame->image.height != info_.height;
      if (size_changed_) return std::nullopt;
      ++shown_;
      frame->time_s += part.start_s - part.from_s;
      frame->index = index_++;
      return frame;
    }
  }

  void take_warnings() {
    if (!reader_) return;
    const std::vector<std::string>& more = reader_->warnings();
    warnings_.insert(warnings_.end(), more.begin(), more.end());
  }

  void warn_of_frames(const VideoOfEpisode& part) {
    if (part_ + 1 == parts_.size()) take_warnings();
    if (size_changed_) {
      warnings_.push_back(fmt::format(
          "{}: the picture changes its size in episode {}; reading stops", name_, part.episode));
    } else if (shown_ < part.frames) {
      warnings_.push_back(fmt::format("{}: episode {} shows {} of {} frames", name_, part.episode,
                                      shown_, part.frames));
    }
  }

  void warn_of_size(const datasets::Feature& camera) {
    const auto declares = [&](int size) {
      return std::ranges::find(camera.shape, static_cast<std::size_t>(size)) != camera.shape.end();
    };
    if (camera.shape.empty() || (declares(info_.width) && declares(info_.height))) return;
    warnings_.push_back(fmt::format("{}: the video is {} x {}, and info.json declares {}", name_,
                                    info_.width, info_.height, fmt::join(camera.shape, " x ")));
  }

  std::string name_;
  double step_s_;
  std::vector<VideoOfEpisode> parts_;
  std::size_t part_ = 0;
  std::size_t shown_ = 0;  // frames of it
  std::unique_ptr<VideoReader> reader_;
  fs::path file_;                    // that it reads
  std::optional<VideoFrame> ahead_;  // of the next part
  double last_s_ = -1.0;             // stamp of the last frame read
  int index_ = 0;
  bool size_changed_ = false;
  VideoInfo info_;
  std::vector<std::string> warnings_;
};

}  // namespace

std::unique_ptr<VideoReader> open_dataset_video(const datasets::Source& source) {
  const datasets::Dataset& dataset = datasets::look_into(source.folder);
  const datasets::Feature& camera = datasets::choose_camera(dataset, source);
  return std::make_unique<DatasetVideoReader>(dataset, camera,
                                              parts_of(dataset, source, camera.name));
}

}  // namespace kinescope
