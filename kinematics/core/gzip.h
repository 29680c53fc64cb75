// SPDX-License-Identifier: Apache-2.0
//
// Files packed with gzip (RFC 1952), unpacked in memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace kinescope {

/// True when the bytes begin as a gzip file does.
[[nodiscard]] bool is_gzip(std::string_view bytes);

/// The unpacked bytes, all members in their order. Throws bad_input, naming `source`: cut off,
/// damaged (checksum), bytes after the end, more than `max_bytes` unpacked.
[[nodiscard]] std::string gunzip(std::string_view bytes, std::string_view source,
                                 std::uintmax_t max_bytes = std::uintmax_t{1} << 30U);

/// Packs; the same bytes for the same input (no name, no time in the header).
[[nodiscard]] std::string gzip(std::string_view bytes);

/// The file's text, unpacked where it is packed. Throws as read_text_file() and gunzip() do.
[[nodiscard]] std::string read_plain_or_gzip(const std::filesystem::path& path);

}  // namespace kinescope
