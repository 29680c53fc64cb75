// SPDX-License-Identifier: Apache-2.0
//
// Packed bytes of a page, in memory: snappy, gzip, zstd.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "kinematics/parquet/file_layout.h"

namespace kinescope::parquet {

/// The most that a page may unpack to: writers make them of a megabyte, arrow of a column chunk.
inline constexpr std::size_t kLargestPage = std::size_t{1} << 28U;

/// The `size` bytes that `packed` stands for. Throws Damage: more, less, no such thing.
[[nodiscard]] std::string unpack_page(Codec codec, std::string_view packed, std::size_t size);

}  // namespace kinescope::parquet
