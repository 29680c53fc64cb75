// SPDX-License-Identifier: Apache-2.0
//
// What poses of a hand do not show. Internal to the room.
#pragma once

#include <string>

#include "calib/hand_eye/fit.h"

namespace kinescope::hand_eye {

/// Throws undetermined where there are fewer poses than any answer can be judged by.
void require_enough_frames(const Data& data, const std::string& source);

/// Throws undetermined, with the directions that are not seen and what to record: a hand that does
/// not turn, or about one axis only; a transform that is known to worse than 0.1 m or 0.1 rad.
void require_observable(const Model& model, const Fit& fit);

}  // namespace kinescope::hand_eye
