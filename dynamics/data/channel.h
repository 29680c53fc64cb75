// SPDX-License-Identifier: Apache-2.0
//
// A column of a log as the checks look at it. Internal to this room.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamics/data/torque_log.h"

namespace kinescope {

struct Channel {
  std::string name;
  std::vector<double> values;
  std::vector<double> changes;  ///< absolute, from row to row of one trajectory
  double sigma = 0.0;
  std::optional<double> step;  ///< of values on a grid
};

[[nodiscard]] double standard_deviation(const Eigen::VectorXd& x);

/// `x`: a value a row of the log.
[[nodiscard]] Channel look_at(const TorqueLog& log, const Eigen::VectorXd& x,
                              const std::string& name);

/// Rows around each row, up to `reach_s` either way and within its trajectory; one at the least.
struct RowWindow {
  Eigen::Index from = 0;
  Eigen::Index to = 0;  ///< the last one
};
[[nodiscard]] std::vector<RowWindow> windows_around_rows(const TorqueLog& log, double reach_s);

/// Median of the changes that are not zero; 0 of a channel that never changes.
[[nodiscard]] double usual_change(const Channel& channel);

[[nodiscard]] std::size_t distinct_values(const Channel& channel);

/// Runs of samples at one extreme that the channel reaches at speed: a turning point slows down
/// first.
struct Clipping {
  int runs = 0;
  Eigen::Index rows = 0, first = -1;
};

/// At the lower and the upper end; none of runs where the channel is not cut off there.
struct ClippedEnd {
  double limit = 0.0;
  Clipping clipping;
};
[[nodiscard]] std::vector<ClippedEnd> clipped_ends(const Channel& channel);

}  // namespace kinescope
