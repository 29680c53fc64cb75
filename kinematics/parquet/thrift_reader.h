// SPDX-License-Identifier: Apache-2.0
//
// Takes   bytes in Thrift's compact protocol.
// Gives   the fields of its structs, one after the other.
// Method  Apache Thrift, doc/specs/thrift-compact-protocol.md. What a caller does not ask for is
//         passed over. No more than a few levels deep: Parquet's own structs have six.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace kinescope::parquet {

class ThriftReader {
 public:
  enum class Type : std::uint8_t {
    kStop = 0,
    kTrue = 1,
    kFalse = 2,
    kByte = 3,
    kI16 = 4,
    kI32 = 5,
    kI64 = 6,
    kDouble = 7,
    kBinary = 8,
    kList = 9,
    kSet = 10,
    kMap = 11,
    kStruct = 12
  };
  struct Field {
    int id = 0;
    Type type = Type::kStop;
  };

  explicit ThriftReader(std::string_view bytes) : bytes_(bytes) {}

  /// Reads a struct; `handle(field)` reads the field's value and returns true, or false: it is
  /// passed over. This and all below throw Damage.
  template <typename Handle>
  void each_field(Handle&& handle) {
    const Level level(*this);
    int last = 0;
    while (const std::optional<Field> field = next_field(last)) {
      if (!handle(*field)) skip(field->type);
    }
  }
  /// Reads a list whose elements are of `type`; `handle(size)` reads one of `size`.
  template <typename Handle>
  void each_element(const Field& field, Type type, Handle&& handle) {
    const Level level(*this);
    const std::size_t size = list_of(field, type);
    for (std::size_t i = 0; i < size; ++i) handle(size);
  }

  [[nodiscard]] std::int64_t integer(const Field& field);  ///< of i8, i16, i32, i64
  [[nodiscard]] std::int64_t i32();                        ///< an element of a list
  [[nodiscard]] bool boolean(const Field& field) const;
  [[nodiscard]] std::string_view binary(const Field& field);
  [[nodiscard]] std::string_view binary();  ///< an element of a list

  /// Bytes that were read.
  [[nodiscard]] std::size_t position() const { return at_; }

 private:
  class Level {
   public:
    explicit Level(ThriftReader& reader);
    ~Level() { --reader_.level_; }
    Level(const Level&) = delete;
    Level& operator=(const Level&) = delete;
    Level(Level&&) = delete;
    Level& operator=(Level&&) = delete;

   private:
    ThriftReader& reader_;
  };

  std::optional<Field> next_field(int& last);
  std::size_t list_of(const Field& field, Type type);
  /// The type and number of a list's elements.
  std::pair<Type, std::size_t> list_header();
  void skip(Type type);
  void skip_elements(Type type, std::size_t count);
  void skip_map();
  std::uint8_t byte();
  std::uint64_t varint();
  std::int64_t zigzag();
  std::string_view take(std::uint64_t size);

  std::string_view bytes_;
  std::size_t at_ = 0;
  int level_ = 0;
};

}  // namespace kinescope::parquet
