// SPDX-License-Identifier: Apache-2.0
//
// What is written, read back by the bags' reader; tests/python reads it by a reader of its own.
#include "kinematics/bags/mcap_writer.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "kinematics/bags/bag.h"
#include "kinematics/core/file.h"
#include "tests/truth/temporary_path.h"

namespace kinescope::bags {
namespace {

McapContent numbered(std::size_t messages) {
  McapContent out{.library = "test", .channels = {}, .messages = {}};
  out.channels.push_back({"/a", "test.A", "jsonschema", "{}", "json"});
  out.channels.push_back({"/b", "test.B", "jsonschema", "{\"type\": \"object\"}", "json"});
  for (std::size_t m = 0; m < messages; ++m)
    out.messages.push_back({m % 2, 1'000'000 * m, std::to_string(m)});
  return out;
}

std::vector<std::string> read_back(const McapContent& content, std::size_t chunk_bytes) {
  const auto path = truth::temporary_path("written.mcap");
  write_file_atomically(path, mcap_file(content, chunk_bytes));
  const auto reader = open(path);
  std::vector<std::string> out;
  while (const auto message = reader->next()) {
    const Topic& topic = reader->topics()[message->topic];
    EXPECT_EQ(topic.encoding_name, "json");
    out.push_back(topic.name + " " + std::to_string(message->received_ns) + " " +
                  std::string(message->data));
  }
  EXPECT_TRUE(reader->warnings().empty());
  return out;
}

TEST(McapWriter, ComesBackInTheOrderOfTimeWhateverTheChunks) {
  constexpr std::size_t kMessages = 500;
  McapContent content = numbered(kMessages);
  const std::vector<std::string> whole = read_back(content, kMcapChunkBytes);
  ASSERT_EQ(whole.size(), kMessages);
  EXPECT_EQ(whole[3], "/b 3000000 3");
  EXPECT_EQ(read_back(content, 100), whole);
  EXPECT_EQ(read_back(content, 0), whole);
  std::ranges::reverse(content.messages);
  EXPECT_EQ(read_back(content, 1000), whole);
}

TEST(McapWriter, MessagesOfOneTimeStayInTheirOrder) {
  McapContent content = numbered(4);
  for (McapMessage& message : content.messages) message.time_ns = 7;
  EXPECT_EQ(read_back(content, 0).back(), "/b 7 3");
}

TEST(McapWriter, WithoutMessagesItIsAFileYet) {
  EXPECT_TRUE(read_back(numbered(0), kMcapChunkBytes).empty());
}

// One bit that is flipped is seen, wherever in the messages it is.
TEST(McapWriter, DamageIsSeen) {
  const auto path = truth::temporary_path("damaged.mcap");
  std::string bytes = mcap_file(numbered(200));
  bytes[bytes.find("zstd") + 60] ^= 1;
  write_file_atomically(path, bytes);
  const auto reader = open(path);
  while (reader->next()) {
  }
  EXPECT_FALSE(reader->warnings().empty());
}

}  // namespace
}  // namespace kinescope::bags
