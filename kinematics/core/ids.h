// SPDX-License-Identifier: Apache-2.0
//
// Ids are types, not ints, so that a link cannot be used where a joint is meant.
#pragma once

#include <compare>
#include <cstddef>
#include <functional>

namespace kinescope {

/// The number a fiducial marker carries (0 and up); also names a body of poses.csv or points.csv.
struct TagId {
  int value = -1;
  auto operator<=>(const TagId&) const = default;
};

/// Position of a link in KinematicTree::links.
struct LinkId {
  int value = -1;
  auto operator<=>(const LinkId&) const = default;
  [[nodiscard]] std::size_t index() const { return static_cast<std::size_t>(value); }
};

/// Position of a joint in KinematicTree::joints.
struct JointId {
  int value = -1;
  auto operator<=>(const JointId&) const = default;
  [[nodiscard]] std::size_t index() const { return static_cast<std::size_t>(value); }
};

}  // namespace kinescope

template <>
struct std::hash<kinescope::TagId> {
  std::size_t operator()(const kinescope::TagId& id) const noexcept {
    return std::hash<int>{}(id.value);
  }
};
