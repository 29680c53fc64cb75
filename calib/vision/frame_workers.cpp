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

using Run = std::vector<VideoFrame>;

// Runs on their way from the reader to the workers; holds a few, so that memory stays small.
class RunQueue {
 public:
  explicit RunQueue(std::size_t capacity) : capacity_(capacity) {}

  // False when nobody will take it any more.
  bool push(Run run) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || runs_.size() < capacity_; });
    if (closed_) return false;
    runs_.push_back(std::move(run));
    changed_.notify_all();
    return true;
  }

  std::optional<Run> pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || !runs_.empty(); });
    if (runs_.empty()) return std::nullopt;
    Run run = std::move(runs_.front());
    runs_.pop_front();
    changed_.notify_all();
    return run;
  }

  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

  void close_and_drop() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    runs_.clear();
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Run> runs_;
  std::size_t capacity_;
  bool closed_ = false;
};

}  // namespace

std::vector<double> for_each_run(VideoReader& reader, std::size_t workers, std::size_t run_length,
                                 const FrameWork& work, FrameTags& results,
                                 const Progress& progress, std::string_view stage) {
  results.clear();
  RunQueue queue(workers);
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work_off = [&](std::size_t worker) {
    try {
      while (const std::optional<Run> run = queue.pop()) {
        FrameTags found = work(worker, *run);
        const std::lock_guard lock(mutex);
        for (std::size_t i = 0; i < run->size(); ++i) {
          const auto index = static_cast<std::size_t>((*run)[i].index);
          if (results.size() <= index) results.resize(index + 1);
          results[index] = std::move(found[i]);
        }
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
    for (std::size_t i = 0; i < workers; ++i) threads.emplace_back(work_off, i);
    try {
      Run run;
      while (std::optional<VideoFrame> frame = reader.next()) {
        times.push_back(frame->time_s);
        run.push_back(std::move(*frame));
        report_progress(progress, stage, static_cast<int>(times.size()), reader.info().frame_count);
        if (run.size() < run_length) continue;
        if (!queue.push(std::exchange(run, {}))) break;
      }
      if (!run.empty()) (void)queue.push(std::move(run));
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
    }
    queue.close();
  }  // threads join
  if (failure) std::rethrow_exception(failure);
  // A file that ends early, or does not say how long it is.
  const int frames = static_cast<int>(times.size());
  if (frames != reader.info().frame_count) report_progress(progress, stage, frames, frames);
  results.resize(times.size());
  return times;
}

}  // namespace kinescope
