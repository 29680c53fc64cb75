// SPDX-License-Identifier: Apache-2.0
//
// What every fuzz target needs: bytes as a file, and what counts as an answer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include <unistd.h>

#include "kinematics/core/error.h"

namespace kinescope::fuzz {

/// The bytes as a file of that name in a folder of this process, for readers that take paths.
inline std::filesystem::path file_of(std::string_view bytes, const std::string& name) {
  static const std::filesystem::path folder = [] {
    auto path =
        std::filesystem::temp_directory_path() / ("kinescope_fuzz_" + std::to_string(getpid()));
    std::filesystem::create_directories(path);
    return path;
  }();
  const std::filesystem::path path = folder / name;
  std::ofstream(path, std::ios::binary | std::ios::trunc)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return path;
}

/// Runs a reader. A line for the user is an answer; every other exception is a finding.
template <typename Read>
void expect_answer(const Read& read) {
  try {
    read();
  } catch (const Error& error) {
    KINESCOPE_CHECK(std::string_view(error.what()).find('\n') == std::string_view::npos,
                    "an error is one line");
  }
}

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};  // NOLINT(*-reinterpret-cast)
}

}  // namespace kinescope::fuzz
