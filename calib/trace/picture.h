// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "calib/trace/stage.h"

namespace kinescope::trace {

/// The effect for the eye: before from the stage without it, after from the one with it. `columns`
/// are the effect's beside the former, `values` its parameters in the latter: a score test may not
/// see what the fit needs.
[[nodiscard]] EffectPicture picture_of(const Stage& without, const Stage& with,
                                       const Candidate& candidate,
                                       const std::vector<EffectColumn>& columns,
                                       const Eigen::VectorXd& values);

}  // namespace kinescope::trace
