// SPDX-License-Identifier: Apache-2.0
#include "kinematics/parquet/encodings.h"

#include <algorithm>
#include <bit>
#include <string>

#include <fmt/format.h>

#include "kinematics/parquet/damage.h"

namespace kinescope::parquet {
namespace {

Damage ends_early() { return {"a page ends before its last value"}; }

std::string_view take(std::string_view& bytes, std::uint64_t size) {
  if (size > bytes.size()) throw ends_early();
  const std::string_view out = bytes.substr(0, static_cast<std::size_t>(size));
  bytes.remove_prefix(out.size());
  return out;
}

std::uint64_t take_varint(std::string_view& bytes) {
  std::uint64_t out = 0;
  for (unsigned shift = 0; shift < 64; shift += 7) {
    const auto part = static_cast<std::uint8_t>(take(bytes, 1).front());
    out |= static_cast<std::uint64_t>(part & 0x7FU) << shift;
    if ((part & 0x80U) == 0) return out;
  }
  throw Damage{"a page has a number without end"};
}

std::uint64_t from_zigzag(std::uint64_t coded) { return (coded >> 1U) ^ (0 - (coded & 1U)); }

/// Numbers of `width` bits side by side, the lowest bit first.
class BitReader {
 public:
  BitReader(std::string_view bytes, unsigned width) : bytes_(bytes), width_(width) {}

  std::uint64_t next() {
    std::uint64_t out = 0;
    for (unsigned done = 0; done < width_;) {
      const std::size_t place = bit_ / 8;
      const auto skipped = static_cast<unsigned>(bit_ % 8);
      if (place >= bytes_.size()) throw ends_early();
      const unsigned some = std::min(8 - skipped, width_ - done);
      const std::uint64_t byte = static_cast<std::uint8_t>(bytes_[place]);
      out |= (byte >> skipped & ((std::uint64_t{1} << some) - 1)) << done;
      done += some;
      bit_ += some;
    }
    return out;
  }

 private:
  std::string_view bytes_;
  unsigned width_;
  std::uint64_t bit_ = 0;
};

/// Bytes that `count` values of so many bytes take.
std::string_view take_values(std::string_view& bytes, std::size_t count, std::size_t size) {
  if (count > bytes.size() / size) throw ends_early();
  return take(bytes, count * size);
}

std::size_t size_of_number(Physical type) {
  switch (type) {
    case Physical::kInt32:
    case Physical::kFloat:
      return 4;
    case Physical::kInt64:
    case Physical::kDouble:
      return 8;
    default:
      throw NotRead{"values of this type"};
  }
}

double number_of(std::uint64_t bits, Physical type) {
  switch (type) {
    case Physical::kInt32:
      return static_cast<std::int32_t>(static_cast<std::uint32_t>(bits));
    case Physical::kInt64:
      return static_cast<double>(static_cast<std::int64_t>(bits));
    case Physical::kFloat:
      return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    case Physical::kDouble:
      return std::bit_cast<double>(bits);
    default:
      throw NotRead{"values of this type"};
  }
}

std::vector<double> plain_numbers(std::string_view bytes, Physical type, std::size_t count) {
  std::vector<double> out;
  if (type == Physical::kBoolean) {
    if (count / 8 > bytes.size()) throw ends_early();
    BitReader bits(bytes, 1);
    out.reserve(count);
    for (std::size_t i = 0; i < count; ++i) out.push_back(static_cast<double>(bits.next()));
    return out;
  }
  const std::size_t size = size_of_number(type);
  const std::string_view values = take_values(bytes, count, size);
  out.reserve(count);
  for (std::size_t i = 0; i < count; ++i)
    out.push_back(number_of(little_endian(values.substr(i * size), size), type));
  return out;
}

/// Truth values as runs, behind their length.
std::vector<double> run_numbers(std::string_view bytes, Physical type, std::size_t count) {
  if (type != Physical::kBoolean) throw Damage{"a page has runs of what are no truth values"};
  constexpr std::size_t kLength = 4;
  const std::uint64_t size = little_endian(take(bytes, kLength), kLength);
  const std::vector<std::uint32_t> read = hybrid_numbers(take(bytes, size), 1, count);
  return {read.begin(), read.end()};
}

/// The first bytes of all values, then the second ones, and so on.
std::vector<double> split_numbers(std::string_view bytes, Physical type, std::size_t count) {
  const std::size_t size = size_of_number(type);
  const std::string_view values = take_values(bytes, count, size);
  std::vector<double> out;
  out.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint64_t bits = 0;
    for (std::size_t byte = size; byte-- > 0;)
      bits = bits << 8U | static_cast<std::uint8_t>(values[byte * count + i]);
    out.push_back(number_of(bits, type));
  }
  return out;
}

std::vector<std::string_view> plain_texts(std::string_view bytes, const Leaf& leaf,
                                          std::size_t count) {
  constexpr std::size_t kLength = 4;
  const bool fixed = leaf.type == Physical::kFixedBytes;
  if (fixed && leaf.fixed_size == 0) throw Damage{"its values have no bytes"};
  if (count > bytes.size() / (fixed ? leaf.fixed_size : kLength)) throw ends_early();
  std::vector<std::string_view> out;
  out.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t size =
        fixed ? leaf.fixed_size : little_endian(take(bytes, kLength), kLength);
    out.push_back(take(bytes, size));
  }
  return out;
}

/// All lengths, then all bytes.
std::vector<std::string_view> delta_length_texts(std::string_view bytes, std::size_t count) {
  std::size_t used = 0;
  const std::vector<std::int64_t> sizes = delta_numbers(bytes, count, used);
  bytes.remove_prefix(used);
  std::vector<std::string_view> out;
  out.reserve(sizes.size());
  for (const std::int64_t size : sizes) {
    if (size < 0) throw Damage{"a page has a text of negative length"};
    out.push_back(take(bytes, static_cast<std::uint64_t>(size)));
  }
  return out;
}

NotRead encoding_not_read(Encoding encoding) {
  return {fmt::format("encoding {}", static_cast<int>(encoding))};
}

/// The head of a page of differences.
struct DeltaHead {
  std::uint64_t block = 0, parts = 0, count = 0, first = 0;
};

DeltaHead take_delta_head(std::string_view& bytes) {
  DeltaHead out;
  out.block = take_varint(bytes);
  out.parts = take_varint(bytes);
  out.count = take_varint(bytes);
  out.first = from_zigzag(take_varint(bytes));
  constexpr std::uint64_t kLargestBlock = 1U << 20U;
  constexpr std::uint64_t kWhole = 32;  // values of a part
  const bool divides = out.parts > 0 && out.block % out.parts == 0;
  if (!divides || out.block == 0 || out.block > kLargestBlock ||
      out.block / out.parts % kWhole != 0)
    throw Damage{"a page of differences has blocks that do not divide"};
  return out;
}

/// Adds one block's values to `out`, at most `count` in all.
void add_block(std::string_view& bytes, const DeltaHead& head, std::size_t count,
               std::vector<std::int64_t>& out) {
  constexpr unsigned kMostBits = 64;
  const std::uint64_t least = from_zigzag(take_varint(bytes));
  const std::string_view widths = take(bytes, head.parts);
  const std::uint64_t per_part = head.block / head.parts;
  for (const char width_byte : widths) {
    if (out.size() == count) return;  // parts behind the last value may be missing
    const auto width = static_cast<std::uint8_t>(width_byte);
    if (width > kMostBits) throw Damage{"a page has differences of more than 64 bits"};
    BitReader bits(take(bytes, per_part / 8 * width), width);
    for (std::uint64_t i = 0; i < per_part && out.size() < count; ++i) {
      const std::uint64_t last = static_cast<std::uint64_t>(out.back());
      out.push_back(static_cast<std::int64_t>(last + least + bits.next()));
    }
  }
}

}  // namespace

std::uint64_t little_endian(std::string_view bytes, std::size_t size) {
  if (size > bytes.size()) throw ends_early();
  std::uint64_t out = 0;
  for (std::size_t i = size; i-- > 0;) out = out << 8U | static_cast<std::uint8_t>(bytes[i]);
  return out;
}

std::vector<std::uint32_t> hybrid_numbers(std::string_view bytes, unsigned width,
                                          std::size_t count) {
  constexpr unsigned kMostBits = 32;
  if (width > kMostBits) throw Damage{"a page has levels or indices of more than 32 bits"};
  std::vector<std::uint32_t> out;
  while (out.size() < count) {
    const std::uint64_t head = take_varint(bytes);
    const std::uint64_t length = head >> 1U;
    const std::size_t wanted = count - out.size();
    if (length == 0) throw Damage{"a page has a run of nothing"};
    if ((head & 1U) == 0) {
      const std::size_t size = (width + 7) / 8;
      const auto value = static_cast<std::uint32_t>(little_endian(take(bytes, size), size));
      out.insert(out.end(), static_cast<std::size_t>(std::min<std::uint64_t>(length, wanted)),
                 value);
      continue;
    }
    // Groups of eight; the last one may be cut off behind the last value.
    const std::uint64_t groups = std::min<std::uint64_t>(length, wanted / 8 + 1);
    BitReader bits(take(bytes, std::min<std::uint64_t>(bytes.size(), groups * width)), width);
    const std::uint64_t values = std::min<std::uint64_t>(groups * 8, wanted);
    for (std::uint64_t i = 0; i < values; ++i)
      out.push_back(static_cast<std::uint32_t>(bits.next()));
  }
  return out;
}

std::vector<std::int64_t> delta_numbers(std::string_view bytes, std::size_t count,
                                        std::size_t& used) {
  const std::size_t before = bytes.size();
  const DeltaHead head = take_delta_head(bytes);
  if (head.count != count) throw Damage{"a page has another number of differences than of values"};
  std::vector<std::int64_t> out;
  if (count > 0) out.push_back(static_cast<std::int64_t>(head.first));
  while (out.size() < count) add_block(bytes, head, count, out);
  used = before - bytes.size();
  return out;
}

std::vector<double> decode_numbers(std::string_view bytes, const Leaf& leaf, Encoding encoding,
                                   std::size_t count) {
  switch (encoding) {
    case Encoding::kPlain:
      return plain_numbers(bytes, leaf.type, count);
    case Encoding::kRle:
      return run_numbers(bytes, leaf.type, count);
    case Encoding::kByteStreamSplit:
      return split_numbers(bytes, leaf.type, count);
    case Encoding::kDeltaBinaryPacked: {
      if (leaf.type != Physical::kInt32 && leaf.type != Physical::kInt64)
        throw Damage{"a page has differences of what are no whole numbers"};
      std::size_t used = 0;
      std::vector<double> out;
      for (const std::int64_t value : delta_numbers(bytes, count, used))
        out.push_back(number_of(static_cast<std::uint64_t>(value), leaf.type));
      return out;
    }
    default:
      throw encoding_not_read(encoding);
  }
}

std::vector<std::string_view> decode_texts(std::string_view bytes, const Leaf& leaf,
                                           Encoding encoding, std::size_t count) {
  if (encoding == Encoding::kPlain) return plain_texts(bytes, leaf, count);
  if (encoding == Encoding::kDeltaLengthByteArray && leaf.type == Physical::kByteArray)
    return delta_length_texts(bytes, count);
  throw encoding_not_read(encoding);
}

}  // namespace kinescope::parquet
