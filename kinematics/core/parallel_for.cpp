// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/parallel_for.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace kinescope {

void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body, int threads) {
  const auto machine = std::max(1U, std::thread::hardware_concurrency());
  const std::size_t wanted =
      std::min(count, threads > 0 ? static_cast<std::size_t>(threads) : machine);
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::size_t failed = count;
  std::exception_ptr error;
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        body(i);
      } catch (...) {
        const std::scoped_lock lock(mutex);
        if (i >= failed) continue;
        failed = i;
        error = std::current_exception();
      }
    }
  };
  {
    std::vector<std::jthread> others;
    for (std::size_t t = 1; t < wanted; ++t) others.emplace_back(work);
    work();
  }
  if (error) std::rethrow_exception(error);
}

}  // namespace kinescope
