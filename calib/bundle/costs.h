// SPDX-License-Identifier: Apache-2.0
//
// The residuals of the bundle, one function each; Ceres takes ownership of what they return.
#pragma once

#include <ceres/cost_function.h>

#include "calib/bundle/corrected.h"
#include "calib/bundle/problem.h"

namespace kinescope::bundle {

/// One sighting, whitened. Blocks: where the camera stands (camera_block(), 7), then for every
/// joint on the way its frame (7) and its map (scale, offset) or its value in this frame (1), the
/// mount (7), the time offset (1), for a further camera its lag (1), for corners the intrinsics
/// (12), for points in a target its place (3), each block of corrections that bears on the
/// sighting: `corrections`. `readings` must follow the time offset.
[[nodiscard]] ceres::CostFunction* make_sighting_cost(const Spec& spec, const Sighting& sighting,
                                                      const Readings& readings,
                                                      std::vector<CorrectionBlock> corrections);
/// The frame of a joint that should stay near the nominal one, but for its zero. Block: the frame
/// (7).
[[nodiscard]] ceres::CostFunction* make_frame_prior(const NominalSigmas& sigmas,
                                                    const Joint& nominal);
/// Its zero: the frame's turn about (shift along) the axis.
[[nodiscard]] ceres::CostFunction* make_zero_prior(const NominalSigmas& sigmas,
                                                   const Joint& nominal);
/// A value that should stay near zero. Block: of `size` corrections, that at `at`.
[[nodiscard]] ceres::CostFunction* make_correction_prior(double sigma, int at, int size);
/// A measured distance. Blocks: both targets' places (3, 3).
[[nodiscard]] ceres::CostFunction* make_distance_cost(const TargetPair& pair);

}  // namespace kinescope::bundle
