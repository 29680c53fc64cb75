// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/frame_workers.h"

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

namespace kinescope {
namespace {

// Frames on their way from the reader to the workers; holds a few, so that memory stays small.
class FrameQueue {
 public:
  explicit FrameQueue(std::size_t capacity) : capacity_(capacity) {}

  // False when nobody will take it any more.
  bool push(VideoFrame frame) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || frames_.size() < capacity_; });
    if (closed_) return false;
    frames_.push_back(std::move(frame));
    changed_.notify_all();
    return true;
  }

  std::optional<VideoFrame> pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || !frames_.empty(); });
    if (frames_.empty()) return std::nullopt;
    VideoFrame frame = std::move(frames_.front());
    frames_.pop_front();
    changed_.notify_all();
    return frame;
  }

  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

  void close_and_drop() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    frames_.clear();
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<VideoFrame> frames_;
  std::size_t capacity_;
  bool closed_ = false;
};

}  // namespace

std::vector<double> for_each_frame(VideoReader& reader, std::size_t workers, const FrameWork& work,
                                   std::vector<std::vector<TagObservation>>& results,
                                   const Progress& progress, std::string_view stage) {
  results.clear();
  FrameQueue queue(2 * workers);
  std::mutex mutex;
  std::exception_ptr failure;
  const auto run = [&](std::size_t worker) {
    try {
      while (const std::optional<VideoFrame> frame = queue.pop()) {
        std::vector<TagObservation> found = work(worker, *frame);
        const std::lock_guard lock(mutex);
        const auto index = static_cast<std::size_t>(frame->index);
        if (results.size() <= index) results.resize(index + 1);
        results[index] = std::move(found);
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
      queue.close_and_drop();
    }
  };
  std::vector<double> times;
  {
    std::vector<std::jthread> threads;
    for (std::size_t i = 0; i < workers; ++i) threads.emplace_back(run, i);
    try {
      while (std::optional<VideoFrame> frame = reader.next()) {
        times.push_back(frame->time_s);
        if (!queue.push(std::move(*frame))) break;
        report_progress(progress, stage, static_cast<int>(times.size()), reader.info().frame_count);
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
    }
    queue.close();
  }  // threads join
  if (failure) std::rethrow_exception(failure);
  results.resize(times.size());
  return times;
}

}  // namespace kinescope
