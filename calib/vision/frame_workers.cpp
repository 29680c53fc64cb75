// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/frame_workers.h"

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

namespace kinescope {
namespace {

using Run = std::span<SearchedFrame>;

// Runs on their way from the reader to the workers; holds a few, so that memory stays small.
class RunQueue {
 public:
  explicit RunQueue(std::size_t capacity) : capacity_(capacity) {}

  // False when nobody will take it any more.
  bool push(Run run) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || runs_.size() < capacity_; });
    if (closed_) return false;
    runs_.push_back(run);
    changed_.notify_all();
    return true;
  }

  std::optional<Run> pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || !runs_.empty(); });
    if (runs_.empty()) return std::nullopt;
    const Run run = runs_.front();
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

std::size_t for_each_run(std::span<SearchedFrame> frames, std::size_t run_length,
                         std::size_t workers, const FillFrame& fill, const RunWork& work) {
  RunQueue queue(workers);
  std::mutex mutex;
  std::exception_ptr failure;
  const auto fail = [&] {
    const std::lock_guard lock(mutex);
    if (!failure) failure = std::current_exception();
  };
  const auto work_off = [&](std::size_t worker) {
    try {
      while (const std::optional<Run> run = queue.pop()) work(worker, *run);
    } catch (...) {
      fail();
      queue.close_and_drop();
    }
  };
  std::size_t filled = 0;
  {
    std::vector<std::jthread> threads;
    for (std::size_t i = 0; i < workers; ++i) threads.emplace_back(work_off, i);
    try {
      std::size_t begin = 0;
      while (filled < frames.size() && fill(frames[filled])) {
        ++filled;
        if (filled - begin < run_length) continue;
        if (!queue.push(frames.subspan(begin, run_length))) break;
        begin = filled;
      }
      if (filled > begin) (void)queue.push(frames.subspan(begin, filled - begin));
    } catch (...) {
      fail();
    }
    queue.close();
  }  // threads join
  if (failure) std::rethrow_exception(failure);
  return filled;
}

}  // namespace kinescope
