// SPDX-License-Identifier: Apache-2.0
//
// The channels at the instants of a series, centred and scaled to unit RMS, in an order that does
// not depend on the file's.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kinematics/log/joint_log.h"
#include "kinematics/structure/series.h"

namespace kinescope::structure_search {

struct Readings {
  Eigen::MatrixXd
      value;  ///< instants x channels, centred, unit RMS; 0 for channels that stand still
  Eigen::MatrixXd rate;          ///< their rates, 1/s
  std::vector<char> valid;       ///< instants at which the log has values
  std::vector<double> mean;      ///< of the channel, in its unit
  std::vector<double> rms;       ///< about the mean, in its unit; 0 when it stands still
  std::vector<int> log_channel;  ///< index into the log
  double si_share = 0.6;  ///< how likely a channel is in rad or m before its joint is looked at

  [[nodiscard]] int channels() const { return static_cast<int>(mean.size()); }
  [[nodiscard]] bool moves(int channel) const {
    return rms[static_cast<std::size_t>(channel)] > 0.0;
  }
};

/// Channels by name.
[[nodiscard]] std::vector<int> channel_order(const JointLog& log);

[[nodiscard]] Readings readings_at(const JointLog& log, const Series& series, double time_offset_s,
                                   double max_gap_s);
/// Of two channels, -1 to 1; 0 where one stands still.
[[nodiscard]] double channel_correlation(const Readings& readings, int a, int b);

/// With the centre and scale of other readings, so that models carry over.
[[nodiscard]] Readings readings_like(const Readings& other, const JointLog& log,
                                     const Series& series, double time_offset_s, double max_gap_s);

}  // namespace kinescope::structure_search
