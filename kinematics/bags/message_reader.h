// SPDX-License-Identifier: Apache-2.0
//
// Takes   the bytes of one message of ROS.
// Gives   its fields, one after the other.
// Method  CDR as DDS writes it (OMG DDS-XTypes 1.3, 7.4: XCDR1 aligns to at most 8 bytes, XCDR2 to
//         4; either order of bytes), or ROS 1's serialization, which aligns nothing.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/bags/bag.h"

namespace kinescope::bags {

/// A message that is not what its type says: too short, a length beyond its end, an unknown header.
struct MessageFault {};

class MessageReader {
 public:
  /// Throws MessageFault.
  MessageReader(std::string_view data, Encoding encoding);

  /// All throw MessageFault at the end of the data.
  std::uint8_t u8();
  std::uint16_t u16();
  std::uint32_t u32();
  std::int32_t i32() { return static_cast<std::int32_t>(u32()); }
  std::uint64_t u64();
  float f32();
  double f64();
  std::string string();
  std::vector<std::string> strings();
  std::vector<double> f64s();
  template <std::size_t N>
  std::array<double, N> f64_array() {
    std::array<double, N> out{};
    for (double& value : out) value = f64();
    return out;
  }
  /// Until the message's data goes.
  std::string_view bytes();
  /// A stamp, ns.
  std::int64_t time_ns();
  /// std_msgs/Header: its stamp, ns.
  std::int64_t header();
  /// The number of elements of a sequence, each of which takes at least `least` bytes.
  std::size_t count(std::size_t least);

 private:
  void align(std::size_t size);
  std::uint64_t number(std::size_t size);
  std::string_view take(std::size_t size);

  std::string_view data_;  // behind the header of CDR
  std::size_t at_ = 0;
  bool ros1_ = false;
  bool big_endian_ = false;
  std::size_t most_aligned_ = 8;
};

}  // namespace kinescope::bags
