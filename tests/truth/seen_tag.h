// SPDX-License-Identifier: Apache-2.0
//
// The corners of one tag as a camera sees it.
#pragma once

#include <optional>

#include "kinematics/core/rng.h"
#include "tests/truth/camera_world.h"

namespace kinescope::truth {

/// With noise; nothing where it is seen from behind, too flat, or not whole within the image.
[[nodiscard]] std::optional<TagObservation> seen_tag(const World& world, const Marker& marker,
                                                     const Pose& T_camera_marker, double sigma_px,
                                                     Rng& rng);

}  // namespace kinescope::truth
