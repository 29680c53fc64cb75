// SPDX-License-Identifier: Apache-2.0
//
// Takes   the bytes of one row group's part of a column.
// Gives   its values, appended row by row.
// Method  pages of parquet-format 2.10; levels to rows and lists as in Dremel (Melnik et al. 2010).
#pragma once

#include <string_view>

#include "kinematics/parquet/file_layout.h"

namespace kinescope::parquet {

/// `rows`: of the row group. Throws Damage, NotRead.
void append_chunk(std::string_view bytes, const Leaf& leaf, const Chunk& chunk, std::uint64_t rows,
                  Numbers& out);
void append_chunk(std::string_view bytes, const Leaf& leaf, const Chunk& chunk, std::uint64_t rows,
                  Texts& out);

}  // namespace kinescope::parquet
