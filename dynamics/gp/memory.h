// SPDX-License-Identifier: Apache-2.0
//
// Whether a kernel matrix fits into memory, asked before anything is computed.
#pragma once

#include <cstddef>
#include <optional>

#include <Eigen/Core>

namespace kinescope::gp {

struct MemoryShortage {
  double needed_gb = 0.0;
  double available_gb = 0.0;
  Eigen::Index fitting_samples = 0;   ///< so many would fit
  Eigen::Index fitting_inducing = 0;  ///< inducing points for the same samples (sparse.h)
};

/// Of `matrices` square ones with samples * outputs rows; limit 0: what the machine has available
/// now. Nothing where they fit.
[[nodiscard]] std::optional<MemoryShortage> memory_shortage(Eigen::Index samples,
                                                            Eigen::Index outputs,
                                                            double matrices = 1.0,
                                                            std::size_t limit_bytes = 0);

/// Memory that can be had without swapping, bytes.
[[nodiscard]] std::size_t available_memory_bytes();

}  // namespace kinescope::gp
