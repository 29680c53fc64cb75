// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace kinescope {

/// SHA-256 of a file in hexadecimal, as sha256sum prints it. Throws bad_input.
[[nodiscard]] std::string sha256_of_file(const std::filesystem::path& path);
/// The same of bytes in memory.
[[nodiscard]] std::string sha256_of_text(std::string_view text);

}  // namespace kinescope
