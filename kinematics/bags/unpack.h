// SPDX-License-Identifier: Apache-2.0
//
// Packed blocks of bags, in memory: zstd, lz4 (frames), bzip2.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace kinescope::bags {

enum class Packing { kNone, kZstd, kLz4, kBzip2 };

/// "" and "none", "zstd", "lz4", "bz2"; nothing for another name.
[[nodiscard]] std::optional<Packing> packing_named(std::string_view name);

/// The most that one block may unpack to: writers make them of a few megabytes, or of one message.
inline constexpr std::uint64_t kLargestBlock = std::uint64_t{1} << 29U;

struct Unpacked {
  std::string bytes;
  bool whole = false;  ///< false: cut off, damaged or longer than `size`; `bytes` goes up to there
};

/// `size`: as declared; what unpacks to more ends there. Without one, up to kLargestBlock.
[[nodiscard]] Unpacked unpack(Packing packing, std::string_view packed,
                              std::optional<std::uint64_t> size = {});

/// Unpacks a zstd file into another. Throws bad_input: damaged, cut off, no space.
void unpack_zstd_file(const std::filesystem::path& packed, const std::filesystem::path& out);

}  // namespace kinescope::bags
