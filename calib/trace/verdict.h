// SPDX-License-Identifier: Apache-2.0
//
// The verdict of a search that has ended, with its reason in one sentence.
#pragma once

#include <optional>
#include <string>

#include "calib/trace/common_motion.h"
#include "calib/trace/stage.h"
#include "calib/trace/trace_result.h"

namespace kinescope::trace {

/// What bodies behind one joint share from instant to instant, where that makes most of what is
/// left.
[[nodiscard]] std::optional<CommonMotion> common_motion(const Stage& stage);

/// True where it is what readings of the joint are known to err by.
[[nodiscard]] bool is_of_readings(const Stage& stage, const CommonMotion& motion);

/// True where a rest at `rest` (a joint, a marker along an axis) and an effect at `effect` are at
/// one place.
[[nodiscard]] bool same_place(const std::string& rest, const std::string& effect);

/// "backlash at joint2 or gear_error at joint2: this recording cannot tell them apart".
[[nodiscard]] std::string cannot_tell_words(const Ambiguity& ambiguity);

/// Fills in verdict and reason from all the rest of `trace`. `now`: the model with the accepted
/// effects; `base_squares`: what the model without any leaves, whitened.
void conclude(const Stage& now, double base_squares, Trace& trace);

}  // namespace kinescope::trace
