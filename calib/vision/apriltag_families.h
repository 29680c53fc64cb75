// SPDX-License-Identifier: Apache-2.0
//
// The families of the packaged AprilTag library by name. Internal to this room (shows AprilTag's
// types).
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <apriltag/apriltag.h>

namespace kinescope {

struct FreeFamily {
  void (*destroy)(apriltag_family_t*) = nullptr;
  void operator()(apriltag_family_t* family) const { destroy(family); }
};
using AprilTagFamily = std::unique_ptr<apriltag_family_t, FreeFamily>;

/// The library's names, then OpenCV's for the same families.
[[nodiscard]] std::vector<std::string> apriltag_family_names();
[[nodiscard]] bool is_apriltag_family(std::string_view name);
/// Null for a name that is none.
[[nodiscard]] AprilTagFamily make_apriltag_family(std::string_view name);

}  // namespace kinescope
