// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/workers.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <limits>
#include <mutex>
#include <thread>

namespace kinescope::gp {

Eigen::Map<Eigen::MatrixXd> Scratch::take(Eigen::Index rows, Eigen::Index cols) {
  const auto size = static_cast<std::size_t>(rows * cols);
  if (used_ == buffers_.size()) buffers_.emplace_back();
  std::vector<double>& buffer = buffers_[used_++];
  if (buffer.size() < size) buffer.resize(size);
  return {buffer.data(), rows, cols};
}

struct Workers::State {
  std::mutex mutex;
  std::condition_variable wake;
  std::condition_variable done;
  const Task* task = nullptr;
  Eigen::Index tasks = 0;
  std::atomic<Eigen::Index> next = 0;
  long round = 0;
  int busy = 0;
  bool stop = false;
  Eigen::Index failed = std::numeric_limits<Eigen::Index>::max();
  std::exception_ptr error;
  std::vector<Scratch> scratch;
  std::vector<std::thread> threads;

  void work(std::size_t worker) {
    for (Eigen::Index i = next++; i < tasks; i = next++) {
      try {
        (*task)(i, scratch[worker]);
      } catch (...) {
        const std::scoped_lock lock(mutex);
        if (i < failed) {
          failed = i;
          error = std::current_exception();
        }
      }
    }
  }

  void loop(std::size_t worker) {
    long seen = 0;
    std::unique_lock lock(mutex);
    while (true) {
      wake.wait(lock, [&] { return stop || round != seen; });
      if (stop) return;
      seen = round;
      lock.unlock();
      work(worker);
      lock.lock();
      if (--busy == 0) done.notify_one();
    }
  }
};

Workers::Workers(int threads) : state_(std::make_unique<State>()) {
  const int wanted =
      threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  state_->scratch.resize(static_cast<std::size_t>(wanted));
  for (std::size_t i = 1; i < state_->scratch.size(); ++i) {
    state_->threads.emplace_back([this, i] { state_->loop(i); });
  }
}

Workers::~Workers() {
  {
    const std::scoped_lock lock(state_->mutex);
    state_->stop = true;
  }
  state_->wake.notify_all();
  for (std::thread& thread : state_->threads) thread.join();
}

int Workers::count() const { return static_cast<int>(state_->scratch.size()); }

Scratch& Workers::scratch() { return state_->scratch.front(); }

void Workers::run(Eigen::Index tasks, const Task& task) {
  State& state = *state_;
  state.task = &task;
  state.tasks = tasks;
  state.next = 0;
  state.failed = std::numeric_limits<Eigen::Index>::max();
  state.error = nullptr;
  const bool share = !state.threads.empty() && tasks > 1;
  if (share) {
    const std::scoped_lock lock(state.mutex);
    state.busy = static_cast<int>(state.threads.size());
    ++state.round;
  }
  if (share) state.wake.notify_all();
  state.work(0);
  if (share) {
    std::unique_lock lock(state.mutex);
    state.done.wait(lock, [&] { return state.busy == 0; });
  }
  if (state.error) std::rethrow_exception(state.error);
}

}  // namespace kinescope::gp
