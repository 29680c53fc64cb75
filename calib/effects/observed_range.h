// SPDX-License-Identifier: Apache-2.0
//
// Takes   an effect of a joint, the robot as calibrated with it.
// Gives   over which values of which joint it was observed, and its weight at any value.
// Method  within the range an effect counts in full; beyond, it goes on by its own formula (or
//         table) times a weight that falls from 1 at the end of the range to 0 a quarter of the
//         range's width farther on: no step, no extrapolation that runs away.
// Not here: effects of camera, clock and markers, and those of time alone; they have no range.
#pragma once

#include <optional>

#include "calib/effects/trace_calibration.h"

namespace kinescope {

/// So far beyond its range an effect has faded out, as a share of the range's width.
inline constexpr double kFadeShare = 0.25;

/// The joint whose value an effect depends on: its own; of a coupling the one that moves it. None
/// where it depends on no joint's value.
[[nodiscard]] std::optional<JointId> deciding_joint(const FittedEffect& effect,
                                                    const KinematicTree& tree);

/// The values of the deciding joint over the recording (Calibration::tree has them as its limits);
/// none without a deciding joint.
[[nodiscard]] std::optional<JointLimits> observed_range(const FittedEffect& effect,
                                                        const KinematicTree& calibrated);

/// How far a value of the deciding joint is from the effect's range, rad or m: 0 within and without
/// a range. What repeats every turn is within its range where the same angle of another turn is.
[[nodiscard]] double beyond_range(const FittedEffect& effect, double value);

/// 1 within the effect's range, 0 from kFadeShare of its width beyond, smooth between.
[[nodiscard]] double range_weight(const FittedEffect& effect, double value);

}  // namespace kinescope
