// SPDX-License-Identifier: Apache-2.0
//
// Takes   a TorqueLog as it was read.
// Gives   the log without the faults that can be repaired, and all faults found.
// Method  each check looks for one kind of fault, by physics where it can (velocity against the
// change of
//         position); thresholds are multiples of the signal's own scale. Nothing is converted in
//         silence: what looks like a wrong unit is a refusal that names the option.
// Not here: torque against a model (torque_scale.h), filtering (motion.h).
#pragma once

#include <optional>
#include <vector>

#include "dynamics/data/log_findings.h"
#include "dynamics/data/torque_log.h"

namespace kinescope {

/// rad, m, Nm: no robot's value.
inline constexpr double kAbsurdValue = 1e9;

struct LogCheckOptions {
  double max_gap_s = 0.0;  ///< longer gaps split a trajectory; 0: ten median steps
};

struct CheckedLog {
  TorqueLog log;
  std::vector<LogFinding> findings;
};

/// Everything below, in the right order. Findings with weight kRefusal are returned, not thrown.
[[nodiscard]] CheckedLog check_log(TorqueLog log, const LogCheckOptions& options = {});

/// Rows with a cell that is missing, NaN, infinite or over 1e9 are left out.
[[nodiscard]] CheckedLog check_numbers(TorqueLog log);
/// Repeated stamps and rows out of order are left out; a clock that starts again begins a
/// trajectory.
[[nodiscard]] CheckedLog check_stamps(TorqueLog log);
/// Rows that repeat the row before while the robot moves are left out.
[[nodiscard]] CheckedLog check_stale_rows(TorqueLog log);
/// Single samples far from their neighbours; their rows are left out.
[[nodiscard]] CheckedLog check_spikes(TorqueLog log);
/// Steps, gaps, rate; long gaps split trajectories.
[[nodiscard]] CheckedLog check_steps(TorqueLog log, const LogCheckOptions& options = {});
/// Jumps by a whole turn are undone.
[[nodiscard]] CheckedLog check_wraps(TorqueLog log);
/// Values that are too large to be rad or m.
[[nodiscard]] std::vector<LogFinding> check_ranges(const TorqueLog& log);
/// Velocity (and acceleration) against the change of position (velocity): unit, sign, factor, lag.
/// What does not fit is removed from the log, to be derived. A log without a clock gets its rate
/// from here.
[[nodiscard]] CheckedLog check_motion(TorqueLog log);
/// Torque readings behind which no measurement stands: at a limit that is reached again and again,
/// frozen while the joint moves, exactly zero in a dead zone. They are marked
/// (TorqueLog::torque_missing) and bridged.
[[nodiscard]] CheckedLog check_readings(TorqueLog log);
/// Channels that are constant, clipped, quantised, renewed too slowly; the lag behind the command.
/// Signals that are constant while the joint moves are removed from the log.
[[nodiscard]] CheckedLog check_channels(TorqueLog log);
/// The distance between neighbouring values of a channel that takes few, equally spaced values.
[[nodiscard]] std::optional<double> grid_step(const std::vector<double>& values);

}  // namespace kinescope
