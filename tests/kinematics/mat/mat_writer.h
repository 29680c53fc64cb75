// SPDX-License-Identifier: Apache-2.0
//
// MAT-files of level 5 as a test makes them, from "MAT-File Format" alone: either order of bytes,
// packed or not, numbers in any storage.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include <zlib.h>

namespace kinescope::mat {

struct MatFormat {
  bool big_endian = false;
  bool packed = false;
};

class MatWriter {
 public:
  explicit MatWriter(MatFormat format = {}) : format_(format) {
    std::string text = "MATLAB 5.0 MAT-file, made by a test";
    text.resize(124, ' ');
    bytes_ = text + number<std::uint16_t>(0x0100) + (format_.big_endian ? "MI" : "IM");
  }

  template <typename Number>
  [[nodiscard]] std::string number(Number value) const {
    std::string out(sizeof value, '\0');
    std::memcpy(out.data(), &value, sizeof value);
    if (format_.big_endian != (std::endian::native == std::endian::big))
      out.assign(out.rbegin(), out.rend());
    return out;
  }

  /// Type, length, bytes, padding; up to four bytes in the tag itself.
  [[nodiscard]] std::string element(std::uint32_t type, std::string data) const {
    if (!data.empty() && data.size() <= 4) {
      const auto size = static_cast<std::uint32_t>(data.size());
      data.resize(4, '\0');
      return number(size << 16U | type) + data;
    }
    const auto size = static_cast<std::uint32_t>(data.size());
    data.resize((data.size() + 7) / 8 * 8, '\0');
    return number(type) + number(size) + data;
  }

  /// `values` column by column, stored as Number (whose data type is `type`) in an array of `kind`.
  template <typename Number>
  MatWriter& matrix(const std::string& name, std::int32_t rows, std::int32_t columns,
                    const std::vector<double>& values, std::uint32_t type, std::uint32_t kind,
                    std::uint32_t flags = 0) {
    std::string numbers;
    for (const double value : values) numbers += number(static_cast<Number>(value));
    return variable(element(6, number(kind | flags) + number(std::uint32_t{0})) +
                    element(5, number(rows) + number(columns)) + element(1, name) +
                    element(type, numbers));
  }
  MatWriter& doubles(const std::string& name, std::int32_t rows, std::int32_t columns,
                     const std::vector<double>& values) {
    return matrix<double>(name, rows, columns, values, 9, 6);
  }

  /// An array's elements as one variable.
  MatWriter& variable(const std::string& content) {
    const std::string whole = element(14, content);
    return raw(format_.packed ? packed(whole) : whole);
  }
  MatWriter& raw(const std::string& bytes) {
    bytes_ += bytes;
    return *this;
  }
  [[nodiscard]] std::string packed(const std::string& whole) const {
    uLongf size = compressBound(whole.size());
    std::string out(size, '\0');
    // NOLINTBEGIN(*-reinterpret-cast): zlib's interface
    compress(reinterpret_cast<Bytef*>(out.data()), &size,
             reinterpret_cast<const Bytef*>(whole.data()), whole.size());
    // NOLINTEND(*-reinterpret-cast)
    out.resize(size);
    return number(std::uint32_t{15}) + number(static_cast<std::uint32_t>(size)) + out;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  MatFormat format_;
  std::string bytes_;
};

}  // namespace kinescope::mat
