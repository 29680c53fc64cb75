// SPDX-License-Identifier: Apache-2.0
//
// Recordings with effects in them, and what tracing says of them: what the tests of tracing share.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calib/effects/trace_calibration.h"
#include "tests/truth/camera_effects.h"

namespace kinescope {

/// px, of a corner's coordinate.
inline constexpr double kSigma = 0.03;
/// What is left of an effect when it has been corrected, as error on unseen frames.
inline constexpr double kWithoutAfterOverClean = 1.05;

/// 33 s of motion before a camera.
[[nodiscard]] truth::EffectWorldOptions filmed(std::vector<truth::InjectedEffect> effects = {},
                                               int frames = 200);
/// The robot at rest before a tracker, posture after posture; of the same motion another `noise`.
[[nodiscard]] truth::World tracked(truth::RobotKind kind, int postures,
                                   std::vector<truth::InjectedEffect> effects,
                                   std::uint64_t noise = 0);

[[nodiscard]] CalibrationStart start_of(const truth::World& world);
[[nodiscard]] CalibrationTrace trace_of(const truth::World& world);
[[nodiscard]] const CalibrationTrace& clean_trace();

/// Ten times what tracing is asked to see at the least.
[[nodiscard]] truth::InjectedEffect strong(const std::string& effect, const std::string& place);

/// In words, for messages.
[[nodiscard]] std::string answer(const Trace& trace);
/// Signs are a convention of the place; sizes are compared without.
[[nodiscard]] bool size_is_right(const TracedEffect& found, double size);

}  // namespace kinescope
