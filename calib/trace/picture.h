// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calib/trace/family.h"
#include "calib/trace/stage.h"

namespace kinescope::trace {

/// The effect for the eye: before from the stage without it, after from the one with it.
[[nodiscard]] EffectPicture picture_of(const Stage& without, const Stage& with,
                                       const Candidate& candidate, const TestedMember& effect);

}  // namespace kinescope::trace
