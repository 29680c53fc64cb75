// SPDX-License-Identifier: Apache-2.0
//
// Data elements of a MAT-file: a type, a length, bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kinescope::mat {

/// What is wrong with a file's bytes; who knows the file's name makes an Error of it.
struct Damage {
  std::string what;
};

/// Data types (MAT-File Format, table 1-1).
enum class ElementType : std::uint32_t {
  kInt8 = 1,
  kUint8 = 2,
  kInt16 = 3,
  kUint16 = 4,
  kInt32 = 5,
  kUint32 = 6,
  kSingle = 7,
  kDouble = 9,
  kInt64 = 12,
  kUint64 = 13,
  kMatrix = 14,
  kCompressed = 15
};

struct Element {
  ElementType type = ElementType::kInt8;
  std::string_view data;
};

/// Elements one after the other.
class ElementReader {
 public:
  ElementReader(std::string_view bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

  /// Nothing at the end. Throws Damage where an element goes on beyond it.
  [[nodiscard]] std::optional<Element> next();
  /// The next one. Throws Damage where there is none.
  [[nodiscard]] Element need(std::string_view what);
  [[nodiscard]] bool big_endian() const { return big_endian_; }

 private:
  std::string_view bytes_;
  bool big_endian_;
};

/// Unsigned, of the order of bytes that the file has.
[[nodiscard]] std::uint64_t unsigned_of(std::string_view bytes, bool big_endian);

/// The element's numbers, `count` of them at most. Throws Damage: a type that is no number, a
/// length that is no multiple of its size.
[[nodiscard]] std::vector<double> numbers_of(const Element& element, bool big_endian);
/// How many those are.
[[nodiscard]] std::size_t count_of(const Element& element);

/// Unpacks zlib's format. Throws Damage: damaged, cut off, more than `most` bytes.
[[nodiscard]] std::string inflated(std::string_view packed, std::size_t most);

}  // namespace kinescope::mat
