// SPDX-License-Identifier: Apache-2.0
//
// Wall-clock times of the stages, for the report.
#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "app/report/run_summary.h"

namespace kinescope {

class Stopwatch {
 public:
  /// Appends the time since the last lap.
  void lap(std::string stage, std::vector<StageTime>& times) {
    const auto now = std::chrono::steady_clock::now();
    times.push_back({std::move(stage), std::chrono::duration<double>(now - last_).count()});
    last_ = now;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace kinescope
