// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calib/effects/suspect.h"

namespace kinescope::effects {

/// What a joint's error is as a function of its value, whatever the cause: a curve (Candidate).
[[nodiscard]] CameraEffect joint_map(const Suspect& s);

}  // namespace kinescope::effects
