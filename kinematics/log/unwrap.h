// SPDX-License-Identifier: Apache-2.0
//
// Takes   one channel over time that may start again at the end of its range: angles in 0..360,
//         -pi..pi, ticks modulo 4096.
// Gives   the channel without those jumps, and where they were; nothing where it does not wrap.
// Units   the channel's own.
// Not here: long gaps, over which nobody knows the turns; real moves, which begin or end at rest.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace kinescope {

struct Unwrapped {
  Eigen::VectorXd values;  ///< the first one is as logged
  double period = 0.0;
  int jumps = 0;
  std::size_t first = 0;  ///< sample before the first jump
};

/// A channel wraps when all its values lie within one period and every step of more than half the
/// period, taken the short way round, goes on with the velocities before and after it, while the
/// channel passes through the jumps or flickers about them. The period is a turn in rad or degrees,
/// of whole numbers also a power of two or a turn in tenths or hundredths of a degree, or what
/// several jumps made in motion agree on.
[[nodiscard]] std::optional<Unwrapped> unwrap(const std::vector<double>& times_s,
                                              const Eigen::VectorXd& values);

}  // namespace kinescope
