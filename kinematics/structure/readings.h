// SPDX-License-Identifier: Apache-2.0
//
// The channels at the instants of a series, centred and scaled to unit RMS, in an order that does
// not depend on the file's.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/log/joint_log.h"
#include "kinematics/structure/channel_unit.h"
#include "kinematics/structure/series.h"

namespace kinescope::structure_search {

struct Readings {
  Eigen::MatrixXd
      value;  ///< instants x channels, centred, unit RMS; 0 for channels that stand still
  Eigen::MatrixXd rate;            ///< their rates, 1/s
  std::vector<char> valid;         ///< instants at which the log has values
  std::vector<double> mean;        ///< of the channel, in its unit
  std::vector<double> rms;         ///< about the mean, in its unit; 0 when it stands still
  std::vector<int> log_channel;    ///< index into the log
  std::vector<ChannelUnit> units;  ///< as declared; empty: of none
  /// How likely a channel of unknown unit is in rad or m before its joint is looked at.
  double si_share = 0.6;
  bool last_joint_first = false;  ///< StructureOptions::camera_on_robot

  [[nodiscard]] int channels() const { return static_cast<int>(mean.size()); }
  [[nodiscard]] bool moves(int channel) const {
    return rms[static_cast<std::size_t>(channel)] > 0.0;
  }
  [[nodiscard]] ChannelUnit unit(int channel) const {
    return units.empty() ? ChannelUnit::kUnknown : units[static_cast<std::size_t>(channel)];
  }
};

/// Channels by name.
[[nodiscard]] std::vector<int> channel_order(const JointLog& log);

[[nodiscard]] Readings readings_at(const JointLog& log, const Series& series, double time_offset_s,
                                   double max_gap_s);
/// Of the channels in the order of the readings.
[[nodiscard]] std::vector<ChannelUnit> units_of(const JointLog& log,
                                                const std::map<std::string, ChannelUnit>& declared);

/// Of two channels, -1 to 1; 0 where one stands still.
[[nodiscard]] double channel_correlation(const Readings& readings, int a, int b);

/// With the centre and scale of other readings, so that models carry over.
[[nodiscard]] Readings readings_like(const Readings& other, const JointLog& log,
                                     const Series& series, double time_offset_s, double max_gap_s);

}  // namespace kinescope::structure_search
