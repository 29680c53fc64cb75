// SPDX-License-Identifier: Apache-2.0
//
// Two names of one equation. T_camera_target = X^-1 B Y says the same of a camera on the hand whose
// log is T_base_flange and of a fixed camera whose log is T_flange_base: no measurement tells them
// apart. What is usual does: brackets are short, tables and stands far, and controllers show
// T_base_flange. Internal to the room.
#pragma once

#include <algorithm>
#include <cmath>

#include "calib/hand_eye/hypothesis.h"

namespace kinescope::hand_eye {

/// Lengths from the flange to what it carries and from the base to what stands before it: log
/// normal. Of five measured sets (ABB, AUBO, FR3, KUKA, UR10) they are 0.10 to 0.28 m, median 0.14,
/// and 0.58 to 2.9 m, median 0.89.
inline constexpr double kUsualMountM = 0.14;
inline constexpr double kUsualFootM = 0.89;
inline constexpr double kUsualSpread = 0.6;  ///< of the logarithm, both
/// Of logs that are T_flange_base; flange.csv is documented as the other.
inline constexpr double kUsualInverted = 0.1;

/// ln of the odds that the camera is on the hand, for a fit under `hypothesis` of the lengths |X|
/// (the camera from the flange, or from the base) and |Y| (the targets from the other).
[[nodiscard]] inline double log_odds_on_hand(double camera_m, double target_m,
                                             const HandEyeHypothesis& hypothesis) {
  constexpr double kShortest = 1e-3;  // m: a camera whose frame is the flange's
  const auto squared = [kShortest](double length_m, double usual_m) {
    const double z = std::log(std::max(length_m, kShortest) / usual_m) / kUsualSpread;
    return z * z;
  };
  const double on_hand = squared(camera_m, kUsualMountM) + squared(target_m, kUsualFootM);
  const double fixed = squared(target_m, kUsualMountM) + squared(camera_m, kUsualFootM);
  // Fitted as base_from_flange, or named the other way round of that.
  const bool on_hand_is_plain = (hypothesis.mount == CameraMount::kOnHand) ==
                                (hypothesis.direction == PoseDirection::kBaseFlange);
  const double convention = std::log((1.0 - kUsualInverted) / kUsualInverted);
  return 0.5 * (fixed - on_hand) + (on_hand_is_plain ? convention : -convention);
}

}  // namespace kinescope::hand_eye
