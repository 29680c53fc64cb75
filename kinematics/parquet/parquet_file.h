// SPDX-License-Identifier: Apache-2.0
//
// Takes   a Parquet file.
// Gives   its columns by name, all row groups one after the other: numbers, texts, lists of them.
// Units   the file's; nothing is converted.
// Method  https://parquet.apache.org/docs/file-format: Thrift metadata (compact protocol), data
//         pages 1 and 2, values plain, by dictionary, RLE, delta and byte-stream-split, packed with
//         nothing, snappy, gzip or zstd. Only the columns that are asked for are read.
// Not here: lists of lists, maps, 96-bit stamps, encryption, columns in other files; what a column
//         means (kinematics/datasets).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace kinescope::parquet {

enum class Kind { kNumbers, kTexts, kNotRead };

struct Column {
  std::string name;  ///< of a list as of a number: "action"; inside a struct "image.bytes"
  Kind kind = Kind::kNumbers;
  bool is_list = false;
};

/// The values of a column, row by row.
template <typename Value>
struct Values {
  std::vector<Value> values;      ///< of all rows
  std::vector<std::size_t> ends;  ///< of each row in `values`; a row that is no list has one value

  [[nodiscard]] std::size_t rows() const { return ends.size(); }
  [[nodiscard]] std::size_t begin_of(std::size_t row) const { return row == 0 ? 0 : ends[row - 1]; }
  [[nodiscard]] std::size_t size_of(std::size_t row) const { return ends[row] - begin_of(row); }
};
/// Whole numbers as doubles (exact up to 2^53), truth values as 0 and 1, nulls as NaN; a list that
/// is null is empty.
using Numbers = Values<double>;
/// Bytes as they stand there, nulls as "".
using Texts = Values<std::string>;

struct Layout;

/// A file whose metadata was read. Throws bad_input that names file, column and remedy: missing,
/// cut off, of another format, damaged; what is not read (see above).
class File {
 public:
  explicit File(const std::filesystem::path& path);
  ~File();
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  File(File&&) = delete;
  File& operator=(File&&) = delete;

  [[nodiscard]] const std::vector<Column>& columns() const { return columns_; }
  [[nodiscard]] bool has(std::string_view name) const;
  [[nodiscard]] std::size_t rows() const;

  /// O(size of the column). Throws bad_input: no column of that name or kind, damaged, too long.
  [[nodiscard]] Numbers numbers(std::string_view name) const;
  [[nodiscard]] Texts texts(std::string_view name) const;

 private:
  template <typename Value>
  [[nodiscard]] Values<Value> read(std::string_view name, Kind kind) const;

  std::filesystem::path path_;
  std::unique_ptr<const Layout> layout_;
  std::vector<Column> columns_;
};

}  // namespace kinescope::parquet
