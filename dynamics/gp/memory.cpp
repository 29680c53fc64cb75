// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/memory.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>

namespace kinescope::gp {

using Eigen::Index;

std::optional<MemoryShortage> memory_shortage(Index samples, Index outputs, double matrices,
                                              std::size_t limit_bytes) {
  const double rows = static_cast<double>(samples) * static_cast<double>(outputs);
  const double needed = matrices * rows * rows * sizeof(double);
  const auto available =
      static_cast<double>(limit_bytes > 0 ? limit_bytes : available_memory_bytes());
  if (needed <= available) return std::nullopt;
  constexpr double kGigabyte = 1e9;
  // sparse.h keeps about eight m x m matrices, and chunks of at least 2 m samples on each worker.
  const double inducing = std::floor(std::sqrt(available / (16.0 * sizeof(double))));
  const double fitting =
      std::floor(std::sqrt(available / (matrices * sizeof(double))) / static_cast<double>(outputs));
  return MemoryShortage{needed / kGigabyte, available / kGigabyte, static_cast<Index>(fitting),
                        std::min(samples, static_cast<Index>(inducing))};
}

std::size_t available_memory_bytes() {
  std::ifstream file("/proc/meminfo");
  std::string key;
  std::size_t kilobytes = 0;
  std::string unit;
  while (file >> key >> kilobytes) {
    std::getline(file, unit);
    if (key == "MemAvailable:") return kilobytes * 1024;
  }
  return std::size_t{8} << 30U;
}

}  // namespace kinescope::gp
