// SPDX-License-Identifier: Apache-2.0
#include "kinematics/mat/mat_elements.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

#include <zlib.h>

#include "kinematics/core/error.h"

namespace kinescope::mat {
namespace {

constexpr std::size_t kTag = 8;  // bytes of type and length, and what elements are padded to

std::size_t size_of(ElementType type) {
  switch (type) {
    case ElementType::kInt8:
    case ElementType::kUint8:
      return 1;
    case ElementType::kInt16:
    case ElementType::kUint16:
      return 2;
    case ElementType::kInt32:
    case ElementType::kUint32:
    case ElementType::kSingle:
      return 4;
    case ElementType::kDouble:
    case ElementType::kInt64:
    case ElementType::kUint64:
      return 8;
    case ElementType::kMatrix:
    case ElementType::kCompressed:
      break;
  }
  throw Damage{"numbers of a type that is none"};
}

// Of `bits` in the element's type.
double number_of(ElementType type, std::uint64_t bits) {
  switch (type) {
    case ElementType::kInt8:
      return static_cast<std::int8_t>(bits);
    case ElementType::kInt16:
      return static_cast<std::int16_t>(bits);
    case ElementType::kInt32:
      return static_cast<std::int32_t>(bits);
    case ElementType::kInt64:
      return static_cast<double>(static_cast<std::int64_t>(bits));
    case ElementType::kSingle:
      return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    case ElementType::kDouble:
      return std::bit_cast<double>(bits);
    default:
      return static_cast<double>(bits);
  }
}

// Ends the stream however the function is left.
class InflateStream {
 public:
  explicit InflateStream(std::string_view packed) {
    // NOLINTNEXTLINE(*-const-cast,*-reinterpret-cast): zlib's interface; it does not write
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
    stream_.avail_in = static_cast<uInt>(packed.size());
    KINESCOPE_CHECK(inflateInit(&stream_) == Z_OK, "zlib has no memory");
  }
  ~InflateStream() { inflateEnd(&stream_); }
  InflateStream(const InflateStream&) = delete;
  InflateStream& operator=(const InflateStream&) = delete;
  InflateStream(InflateStream&&) = delete;
  InflateStream& operator=(InflateStream&&) = delete;

  // Adds what `room` holds; true at the end of the stream. Throws Damage.
  template <std::size_t N>
  bool advance(std::array<char, N>& room, std::string& out) {
    stream_.next_out = reinterpret_cast<Bytef*>(room.data());  // NOLINT(*-reinterpret-cast)
    stream_.avail_out = N;
    const int status = inflate(&stream_, Z_NO_FLUSH);
    if (status != Z_OK && status != Z_STREAM_END) throw Damage{"a packed variable is damaged"};
    out.append(room.data(), N - stream_.avail_out);
    return status == Z_STREAM_END;
  }

 private:
  z_stream stream_{};
};

}  // namespace

std::uint64_t unsigned_of(std::string_view bytes, bool big_endian) {
  std::uint64_t out = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const char byte = big_endian ? bytes[i] : bytes[bytes.size() - 1 - i];
    out = out << 8U | static_cast<unsigned char>(byte);
  }
  return out;
}

std::optional<Element> ElementReader::next() {
  if (bytes_.empty()) return std::nullopt;
  if (bytes_.size() < kTag) throw Damage{"it ends inside an element"};
  const std::uint64_t word = unsigned_of(bytes_.substr(0, 4), big_endian_);
  // Up to four bytes stand in the tag itself, their number in the upper half of its first word.
  if (const std::uint64_t small = word >> 16U; small != 0) {
    if (small > 4) throw Damage{"a small element of more than 4 bytes"};
    const Element out{static_cast<ElementType>(word & 0xFFFFU), bytes_.substr(4, small)};
    bytes_.remove_prefix(kTag);
    return out;
  }
  const auto size = static_cast<std::size_t>(unsigned_of(bytes_.substr(4, 4), big_endian_));
  bytes_.remove_prefix(kTag);
  if (size > bytes_.size()) throw Damage{"it ends inside an element"};
  const Element out{static_cast<ElementType>(word), bytes_.substr(0, size)};
  const bool is_padded = out.type != ElementType::kCompressed;
  const std::size_t whole = is_padded ? (size + kTag - 1) / kTag * kTag : size;
  bytes_.remove_prefix(std::min(whole, bytes_.size()));
  return out;
}

Element ElementReader::need(std::string_view what) {
  if (auto out = next()) return *out;
  throw Damage{"a variable without its " + std::string(what)};
}

std::size_t count_of(const Element& element) {
  const std::size_t size = size_of(element.type);
  if (element.data.size() % size != 0) throw Damage{"numbers that are cut in two"};
  return element.data.size() / size;
}

std::vector<double> numbers_of(const Element& element, bool big_endian) {
  const std::size_t size = size_of(element.type);
  std::vector<double> out(count_of(element));
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = number_of(element.type, unsigned_of(element.data.substr(i * size, size), big_endian));
  return out;
}

std::string inflated(std::string_view packed, std::size_t most) {
  constexpr std::size_t kStep = std::size_t{1} << 16U;
  if (packed.size() > std::numeric_limits<uInt>::max())
    throw Damage{"a packed variable is too large"};
  InflateStream stream(packed);
  std::array<char, kStep> room{};
  std::string out;
  for (bool ended = false; !ended;) {
    ended = stream.advance(room, out);
    if (out.size() > most) throw Damage{"it unpacks to more than 1 GiB"};
  }
  return out;
}

}  // namespace kinescope::mat
