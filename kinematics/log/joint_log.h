// SPDX-License-Identifier: Apache-2.0
//
// Takes   joints.csv: `t` in s, then one column a channel (rad, m or raw ticks), any order and
// name.
// Gives   JointLog: named channels over their own clock, and their values between the
// samples. Method  cubic Hermite interpolation with three-point slopes (Catmull-Rom for uneven
// steps). Not here: which channel drives what (kinematics/structure), torques (dynamics).
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace kinescope {

/// The longest gap between samples that is interpolated, s.
inline constexpr double kMaxGap = 0.5;

/// Joint values over time. All channels share the stamps.
struct JointLog {
  std::string source;                 ///< file name, for messages; empty when made by hand
  std::vector<double> times_s;        ///< strictly increasing
  std::vector<std::string> channels;  ///< names, in the file's order
  Eigen::MatrixXd values;             ///< samples x channels, in the channel's own unit
  std::string time_column = "t";      ///< its name in the file
  std::vector<std::string> torque_columns = {};  ///< in the file's order
  std::vector<std::string> left_out = {};        ///< other columns that are no channel
  /// What a declared unit made the values be multiplied by; channels that stayed as logged are
  /// absent.
  std::map<std::string, double> unit_factors = {};
  std::vector<std::string> warnings = {};  ///< what was left out, and why
  /// First stamps of what was recorded some time after the row before (episodes): how long that was
  /// is not known, and the gap says nothing.
  std::vector<double> joined_at_s = {};

  [[nodiscard]] bool is_joined_between(double from_s, double to_s) const;  ///< up to `to_s`
  [[nodiscard]] std::size_t size() const { return times_s.size(); }
  [[nodiscard]] bool empty() const { return times_s.empty(); }
  [[nodiscard]] std::optional<int> channel(std::string_view name) const;
};

/// A channel's value and rate at a time.
struct ChannelValue {
  double value = 0.0;
  double rate = 0.0;  ///< per s
};

/// Reads joints.csv. `torque_channels` and columns that begin with "tau" are left out. Without a
/// column `t` one named time, stamp or timestamp is the time; a unit in brackets is no part of a
/// name (header_units.h). Left out with a warning: rows that repeat the one before, columns without
/// any number, first rows in which a channel is blank, a few bad rows (bad_rows.h).
/// Throws bad_input: missing or empty file, no time, many rows with a cell that is no finite
/// number, or out of the order of time, no channel. Each names file, line and remedy.
[[nodiscard]] JointLog read_joint_log(const std::filesystem::path& path,
                                      const std::vector<std::string>& torque_channels = {});
[[nodiscard]] JointLog parse_joint_log(std::string_view text, const std::string& source,
                                       const std::vector<std::string>& torque_channels = {});

/// The channel at `time_s`, or nothing before the first, after the last sample, or inside a gap
/// longer than `max_gap_s`. O(log samples).
[[nodiscard]] std::optional<ChannelValue> interpolate(const JointLog& log, int channel,
                                                      double time_s, double max_gap_s = kMaxGap);

/// All channels at the given times: times x channels; rows that cannot be interpolated are NaN.
[[nodiscard]] Eigen::MatrixXd resample(const JointLog& log, const std::vector<double>& times_s,
                                       double time_offset_s = 0.0, double max_gap_s = kMaxGap);

/// Resampled rates (per s), as resample().
[[nodiscard]] Eigen::MatrixXd resample_rates(const JointLog& log,
                                             const std::vector<double>& times_s,
                                             double time_offset_s = 0.0,
                                             double max_gap_s = kMaxGap);

/// True where a row of the log has exactly this stamp.
[[nodiscard]] bool is_stamp(const JointLog& log, double time_s);

/// True for postures measured at rest, with nothing to interpolate and no clock to align: the times
/// are exactly stamps of the log (most of them: a row may have been left out, and nothing was read
/// then), and none of these channels (those that drive a
/// joint) moves smoothly from stamp to stamp. A script that writes a moving robot's readings once a
/// frame has the frames' stamps, too, but the lag between camera and readings is to be found.
/// Stamps alone cannot tell a sweep in equal steps from a motion: it is one when its stamps are no
/// more than kMaxGap apart.
[[nodiscard]] bool is_posture_log(const JointLog& log, const std::vector<double>& times_s,
                                  const std::vector<int>& channels);

}  // namespace kinescope
