// SPDX-License-Identifier: Apache-2.0
//
// Parquet files as a test makes them: one row group, plain values, nothing packed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

namespace kinescope::truth {

/// A column of a file: numbers (INT64, FLOAT, DOUBLE), texts, or lists of floats, one a row.
struct ParquetColumn {
  std::string name;
  std::variant<std::vector<std::int64_t>, std::vector<float>, std::vector<double>,
               std::vector<std::string>, std::vector<std::vector<float>>>
      values;
};

/// The file's bytes.
[[nodiscard]] std::string parquet_bytes(const std::vector<ParquetColumn>& columns);
/// Makes the folder, too.
void write_parquet(const std::filesystem::path& path, const std::vector<ParquetColumn>& columns);

/// Structs in Thrift's compact protocol, field by field in the order of their numbers.
class ThriftWriter {
 public:
  ThriftWriter& i32(int field, std::int64_t value) { return head(field, 5).zigzag(value); }
  ThriftWriter& i64(int field, std::int64_t value) { return head(field, 6).zigzag(value); }
  ThriftWriter& text(int field, const std::string& text);
  ThriftWriter& inside(int field, const ThriftWriter& other);
  ThriftWriter& structs(int field, const std::vector<ThriftWriter>& elements);
  ThriftWriter& texts(int field, const std::vector<std::string>& elements);
  ThriftWriter& i32s(int field, const std::vector<std::int64_t>& elements);
  /// With the byte that ends a struct.
  [[nodiscard]] std::string bytes() const { return bytes_ + '\0'; }

 private:
  ThriftWriter& head(int field, unsigned type);
  ThriftWriter& list(int field, unsigned type, std::size_t size);
  ThriftWriter& zigzag(std::int64_t value);
  ThriftWriter& varint(std::uint64_t value);

  std::string bytes_;
  int last_ = 0;
};

}  // namespace kinescope::truth
