// SPDX-License-Identifier: Apache-2.0
#include "kinematics/bags/message_reader.h"

#include <algorithm>
#include <bit>

namespace kinescope::bags {
namespace {

// The second byte of the header of encapsulation.
constexpr std::uint8_t kPlainCdr = 0x00;   // and, with the lowest bit, little-endian
constexpr std::uint8_t kPlainCdr2 = 0x06;  // likewise

}  // namespace

MessageReader::MessageReader(std::string_view data, Encoding encoding) : data_(data) {
  if (encoding == Encoding::kRos1) {
    ros1_ = true;
    return;
  }
  constexpr std::size_t kHeader = 4;
  if (encoding != Encoding::kCdr || data.size() < kHeader || data[0] != 0) throw MessageFault{};
  const auto kind = static_cast<std::uint8_t>(data[1]);
  const std::uint8_t layout = kind & 0xFEU;
  if (layout != kPlainCdr && layout != kPlainCdr2) throw MessageFault{};
  big_endian_ = (kind & 1U) == 0;
  if (layout == kPlainCdr2) most_aligned_ = 4;
  data_.remove_prefix(kHeader);
}

void MessageReader::align(std::size_t size) {
  if (ros1_) return;
  const std::size_t step = std::min(size, most_aligned_);
  at_ = (at_ + step - 1) / step * step;
}

std::string_view MessageReader::take(std::size_t size) {
  if (at_ > data_.size() || size > data_.size() - at_) throw MessageFault{};
  const std::string_view out = data_.substr(at_, size);
  at_ += size;
  return out;
}

std::uint64_t MessageReader::number(std::size_t size) {
  align(size);
  const std::string_view bytes = take(size);
  std::uint64_t out = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const char byte = bytes[big_endian_ ? i : size - 1 - i];
    out = out << 8U | static_cast<std::uint8_t>(byte);
  }
  return out;
}

std::uint8_t MessageReader::u8() { return static_cast<std::uint8_t>(number(1)); }
std::uint16_t MessageReader::u16() { return static_cast<std::uint16_t>(number(2)); }
std::uint32_t MessageReader::u32() { return static_cast<std::uint32_t>(number(4)); }
std::uint64_t MessageReader::u64() { return number(8); }
float MessageReader::f32() { return std::bit_cast<float>(u32()); }
double MessageReader::f64() { return std::bit_cast<double>(u64()); }

std::size_t MessageReader::count(std::size_t least) {
  const std::size_t elements = u32();
  if (elements > (data_.size() - at_) / least) throw MessageFault{};
  return elements;
}

std::string MessageReader::string() {
  std::string_view text = take(count(1));
  if (!ros1_ && !text.empty() && text.back() == '\0') text.remove_suffix(1);
  return std::string(text);
}

std::vector<std::string> MessageReader::strings() {
  constexpr std::size_t kLength = 4;
  std::vector<std::string> out(count(kLength));
  for (std::string& text : out) text = string();
  return out;
}

std::vector<double> MessageReader::f64s() {
  std::vector<double> out(count(sizeof(double)));
  for (double& value : out) value = f64();
  return out;
}

std::string_view MessageReader::bytes() { return take(count(1)); }

std::int64_t MessageReader::time_ns() {
  const std::int64_t seconds = ros1_ ? static_cast<std::int64_t>(u32()) : i32();
  return seconds * 1'000'000'000 + u32();
}

std::int64_t MessageReader::header() {
  if (ros1_) static_cast<void>(u32());  // its number
  const std::int64_t stamp_ns = time_ns();
  static_cast<void>(string());  // frame
  return stamp_ns;
}

}  // namespace kinescope::bags
