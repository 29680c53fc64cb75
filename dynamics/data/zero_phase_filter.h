// SPDX-License-Identifier: Apache-2.0
//
// Butterworth low-pass run forward and backward over evenly spaced samples: no phase, twice the
// attenuation. The cut-off is where the two passes together have fallen by 3 dB.
// Source: Gustafsson 1996 (ends); Winter 2009, sec. 2.2.4.4 (cut-off of repeated passes).
#pragma once

#include <vector>

#include <Eigen/Core>

namespace kinescope {

/// A part of a log with fewer rows is not filtered.
inline constexpr Eigen::Index kFewestFilteredRows = 32;

/// A second-order section, a0 = 1.
struct FilterSection {
  double b0 = 1.0, b1 = 0.0, b2 = 0.0, a1 = 0.0, a2 = 0.0;
};

/// Sections of a Butterworth low-pass by the bilinear transform. `order` 1 to 8; 0 < cutoff < rate
/// / 2.
[[nodiscard]] std::vector<FilterSection> butterworth(int order, double cutoff_hz, double rate_hz);

/// Both passes, -3 dB together at `cutoff_hz`. The ends are continued as the odd reflection about
/// the end points and the filter starts in its steady state. Rows are samples. O(samples x signals
/// x order).
[[nodiscard]] Eigen::MatrixXd filter_zero_phase(const Eigen::MatrixXd& values, int order,
                                                double cutoff_hz, double rate_hz);

/// Derivative of evenly spaced samples by central differences of order 8 (one-sided of lower order
/// at the four samples at either end). Fornberg 1988, table 1.
[[nodiscard]] Eigen::MatrixXd central_differences(const Eigen::MatrixXd& values, double step_s);

}  // namespace kinescope
