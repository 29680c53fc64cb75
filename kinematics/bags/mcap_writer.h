// SPDX-License-Identifier: Apache-2.0
//
// Takes   channels with their schemas, and messages.
// Gives   an MCAP file as bytes: chunks packed with zstd and their message indexes, then a summary
//         (schemas, channels, statistics, chunk indexes) with its offsets; a CRC over every chunk,
//         over the data and over the summary.
// Method  https://mcap.dev/spec; the same input gives the same bytes.
// Not here: reading (bag.h), what a message says.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace kinescope::bags {

struct McapChannel {
  std::string topic;
  std::string schema_name;
  std::string schema_encoding;  ///< "jsonschema"
  std::string schema;
  std::string message_encoding;  ///< "json"
};

struct McapMessage {
  std::size_t channel = 0;    ///< index into the channels
  std::uint64_t time_ns = 0;  ///< when it was logged and published
  std::string data;
};

struct McapContent {
  std::string library;  ///< who wrote it
  std::vector<McapChannel> channels;
  std::vector<McapMessage> messages;  ///< written in the order of their times
};

/// About so many bytes of messages are packed together.
inline constexpr std::size_t kMcapChunkBytes = std::size_t{1} << 18U;

[[nodiscard]] std::string mcap_file(const McapContent& content,
                                    std::size_t chunk_bytes = kMcapChunkBytes);

}  // namespace kinescope::bags
