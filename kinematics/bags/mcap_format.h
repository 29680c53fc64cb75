// SPDX-License-Identifier: Apache-2.0
//
// What reader and writer of MCAP share (https://mcap.dev/spec).
#pragma once

#include <cstdint>
#include <string_view>

namespace kinescope::bags {

inline constexpr std::string_view kMcapMagic("\x89MCAP0\r\n", 8);

/// Opcodes; those that are not named here are passed over.
enum class McapRecord : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F
};

/// CRC-32 as of zlib.
[[nodiscard]] std::uint32_t mcap_checksum(std::string_view bytes);

}  // namespace kinescope::bags
