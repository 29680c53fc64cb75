// SPDX-License-Identifier: Apache-2.0
//
// What a log of flange poses beside a camera may mean.
#pragma once

#include <optional>
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

/// How a log of flange poses is to be read (the key `flange` of recording.yaml); what is not said
/// is as usual.
struct FlangeDeclaration {
  std::string rotation;              ///< name of a convention; empty: as the columns are named
  bool conjugate = false;            ///< the rotations are inverted, the positions not
  std::optional<bool> degrees = {};  ///< of angles; none: by the header
  int row_offset = 0;                ///< image n has the pose of row (or number) n + row_offset
  bool operator==(const FlangeDeclaration&) const = default;
};

/// One reading of a recording.
struct HandEyeHypothesis {
  CameraMount mount = CameraMount::kOnHand;
  PoseDirection direction = PoseDirection::kBaseFlange;
  std::string rotation;  ///< how the log's columns are read as a rotation, in words
  bool operator==(const HandEyeHypothesis&) const = default;
};

}  // namespace kinescope
