// SPDX-License-Identifier: Apache-2.0
//
// Takes   the bytes of a page's levels or values.
// Gives   as many of them as are asked for.
// Method  parquet-format 2.10, Encodings.md. All throw Damage where the bytes end early or say what
//         cannot be, NotRead for an encoding that is not read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "kinematics/parquet/file_layout.h"

namespace kinescope::parquet {

/// A little-endian number that the bytes begin with.
[[nodiscard]] std::uint64_t little_endian(std::string_view bytes, std::size_t size);

/// Runs of one number, and numbers of `width` bits side by side (0 to 32).
[[nodiscard]] std::vector<std::uint32_t> hybrid_numbers(std::string_view bytes, unsigned width,
                                                        std::size_t count);
/// Whole numbers as differences, wrapped to 64 bits. `used`: the bytes that they took.
[[nodiscard]] std::vector<std::int64_t> delta_numbers(std::string_view bytes, std::size_t count,
                                                      std::size_t& used);

/// Values that stand there themselves; those of a dictionary are indices into it.
[[nodiscard]] std::vector<double> decode_numbers(std::string_view bytes, const Leaf& leaf,
                                                 Encoding encoding, std::size_t count);
/// Until the page's bytes go.
[[nodiscard]] std::vector<std::string_view> decode_texts(std::string_view bytes, const Leaf& leaf,
                                                         Encoding encoding, std::size_t count);

}  // namespace kinescope::parquet
