// SPDX-License-Identifier: Apache-2.0
//
// What a log of flange poses beside a camera may mean.
#pragma once

#include <string>
#include <string_view>

namespace kinescope {

/// Where the camera is: on the hand, and the markers stand still; or fixed, and they are on the
/// hand. Of a robot also: carried by a person.
enum class CameraMount { kOnHand, kFixed, kCarried };

/// "hand", "fixed", "carried".
[[nodiscard]] constexpr std::string_view to_string(CameraMount mount) {
  if (mount == CameraMount::kCarried) return "carried";
  return mount == CameraMount::kOnHand ? "hand" : "fixed";
}

/// Which way round the log's poses are: T_base_flange (what controllers show) or T_flange_base.
enum class PoseDirection { kBaseFlange, kFlangeBase };

/// "base_from_flange", "flange_from_base".
[[nodiscard]] constexpr std::string_view to_string(PoseDirection direction) {
  return direction == PoseDirection::kBaseFlange ? "base_from_flange" : "flange_from_base";
}

/// One reading of a recording.
struct HandEyeHypothesis {
  CameraMount mount = CameraMount::kOnHand;
  PoseDirection direction = PoseDirection::kBaseFlange;
  std::string rotation;  ///< how the log's columns are read as a rotation, in words
  bool operator==(const HandEyeHypothesis&) const = default;
};

}  // namespace kinescope
