// SPDX-License-Identifier: Apache-2.0
//
// Where the recordings of others lie. They are not part of the project; tests that want them skip
// where they are absent.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string_view>

namespace kinescope {

/// The file or folder below shared/data, or nothing where it is not on this machine.
[[nodiscard]] inline std::optional<std::filesystem::path> shared_data(std::string_view relative) {
  const char* declared = std::getenv("KINESCOPE_SHARED_DATA");  // NOLINT(concurrency-mt-unsafe)
  const std::filesystem::path root =
      declared != nullptr ? std::filesystem::path(declared)
                          : std::filesystem::path(KINESCOPE_SOURCE_DIR) / ".." / "shared" / "data";
  std::filesystem::path path = root / relative;
  if (!std::filesystem::exists(path)) return std::nullopt;
  return path;
}

}  // namespace kinescope
