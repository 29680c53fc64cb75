// SPDX-License-Identifier: Apache-2.0
//
// Takes   the metadata of a Parquet file, of a page.
// Gives   them as structs, checked against each other.
// Method  parquet-format 2.10: parquet.thrift; levels as in Dremel (Melnik et al. 2010, section 4).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/parquet/parquet_file.h"

namespace kinescope::parquet {

// Numbers of parquet.thrift.
enum class Physical {
  kBoolean = 0,
  kInt32 = 1,
  kInt64 = 2,
  kInt96 = 3,
  kFloat = 4,
  kDouble = 5,
  kByteArray = 6,
  kFixedBytes = 7
};
enum class Encoding {
  kPlain = 0,
  kPlainDictionary = 2,
  kRle = 3,
  kBitPacked = 4,
  kDeltaBinaryPacked = 5,
  kDeltaLengthByteArray = 6,
  kDeltaByteArray = 7,
  kRleDictionary = 8,
  kByteStreamSplit = 9
};
enum class Codec { kNone = 0, kSnappy = 1, kGzip = 2, kZstd = 6 };
enum class PageType { kData = 0, kIndex = 1, kDictionary = 2, kDataV2 = 3 };

/// A column of values: a leaf of the schema.
struct Leaf {
  std::string name;  ///< as Column::name
  Physical type = Physical::kInt32;
  std::size_t fixed_size = 0;  ///< bytes, of kFixedBytes
  int most_defined = 0;        ///< definition level of a value that is there
  int most_repeated = 0;       ///< number of lists around it
  int in_list = 0;             ///< definition level from which on the (only) list has an element
};

/// One row group's part of a column.
struct Chunk {
  Codec codec = Codec::kNone;
  std::uint64_t values = 0;  ///< nulls and empty lists counted as one
  std::uint64_t begin = 0;   ///< in the file
  std::uint64_t size = 0;    ///< bytes, with the headers of its pages
  std::uint64_t unpacked = 0;
};

struct RowGroup {
  std::uint64_t rows = 0;
  std::vector<Chunk> chunks;  ///< one a leaf
};

struct Layout {
  std::vector<Leaf> leaves;
  std::vector<RowGroup> groups;
};

struct PageHeader {
  PageType type = PageType::kData;
  std::size_t packed_size = 0, unpacked_size = 0;
  std::size_t values = 0;
  Encoding encoding = Encoding::kPlain;
  // Of a page of version 2, whose levels are not packed.
  std::size_t defined_size = 0, repeated_size = 0;
  bool is_packed = true;
  std::size_t header_size = 0;
};

/// `footer`: the metadata at the end of a file of `file_size` bytes. Throws Damage, NotRead.
[[nodiscard]] Layout read_layout(std::string_view footer, std::uint64_t file_size);
/// The header that `bytes` begin with. Throws Damage.
[[nodiscard]] PageHeader read_page_header(std::string_view bytes);

}  // namespace kinescope::parquet
