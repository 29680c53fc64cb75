// SPDX-License-Identifier: Apache-2.0
//
// Takes   a path of the command line that may lead into a bag or a dataset: "arm.mcap:/joints",
//         "so101:observation.images.top".
// Gives   what it names: the bag or dataset, and its files.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace kinescope::recorded {

/// A bag or a dataset.
struct Container {
  std::filesystem::path path;
  std::string part;  ///< of it: a topic, a camera, episodes; empty: not said
};

/// Nothing where the path names neither.
[[nodiscard]] std::optional<Container> container_of(const std::filesystem::path& path);

/// The files that a path stands for: those of a bag or dataset, or itself. Throws as their readers.
[[nodiscard]] std::vector<std::filesystem::path> parts_of(const std::filesystem::path& path);
/// A path's last component, with the part: "arm.mcap:/joint_states".
[[nodiscard]] std::string short_name(const std::filesystem::path& path);
/// The folders in which a container's other files (tags.yaml) may stand, first looked into first:
/// a folder of a bag itself, that around a bag's file; a dataset, whose folder LeRobot rules, and
/// that around it.
[[nodiscard]] std::vector<std::filesystem::path> places_of(const Container& container);

}  // namespace kinescope::recorded
