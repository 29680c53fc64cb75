// SPDX-License-Identifier: Apache-2.0
//
// recording.yaml, key `dynamics`: what the columns of a torque log are, and how it is filtered.
#pragma once

#include <filesystem>

#include "dynamics/data/torque_data.h"

namespace kinescope {

/// Keys below `dynamics`: time, time_unit, rate_hz, trajectory; position, velocity, acceleration,
/// torque (a column, a pattern with `*`, or a list); position_unit, velocity_unit,
/// acceleration_unit, torque_unit; position_factor, torque_factor; joints (joint's name: what the
/// log calls it); filter (spline, butterworth, none), source (best, position, velocity, logged),
/// cutoff_hz, sample_rate_hz, edge_periods, max_gap_s. The key `torques` beside it names the torque
/// columns too. Defaults where there is nothing.
[[nodiscard]] TorqueDataOptions read_dynamics_settings(const std::filesystem::path& path);

}  // namespace kinescope
