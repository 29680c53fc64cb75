// SPDX-License-Identifier: Apache-2.0
//
// Takes   a bag: MCAP (.mcap), ROS 2's sqlite3 (.db3), a folder of either with its metadata.yaml,
//         or ROS 1's format 2.0 (.bag).
// Gives   its topics, and its messages one by one as the bytes that were recorded.
// Units   stamps in ns since the epoch of the recorder's clock.
// Method  MCAP: https://mcap.dev/spec; ROS 1: http://wiki.ros.org/Bags/Format/2.0; rosbag2: tables
//         `topics` and `messages`. Files are read from front to back; no index is needed, so that a
//         bag whose recorder was killed is read like any other, up to where it ends.
// Not here: what a message says (messages.h), what of it is a recording (bag_contents.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kinescope::bags {

/// How the bytes of a topic's messages are laid out.
enum class Encoding { kCdr, kRos1, kOther };

struct Topic {
  std::string name;           ///< "/joint_states"
  std::string type;           ///< "sensor_msgs/JointState", of ROS 1 and ROS 2 alike
  std::string encoding_name;  ///< as the bag says it: "cdr", "ros1", "protobuf", ..
  Encoding encoding = Encoding::kOther;
};

struct Message {
  std::size_t topic = 0;         ///< index of Reader::topics()
  std::int64_t received_ns = 0;  ///< when the recorder had it
  std::string_view data;         ///< until the next call of next()
};

/// Messages in the order of the file (of sqlite3: of their receive stamps).
class Reader {
 public:
  virtual ~Reader() = default;
  /// Those that were met so far; all of them after the last message.
  [[nodiscard]] virtual const std::vector<Topic>& topics() const = 0;
  [[nodiscard]] virtual std::optional<Message> next() = 0;
  /// What was wrong on the way, one line each: a file that ends early, damaged chunks.
  [[nodiscard]] virtual const std::vector<std::string>& warnings() const = 0;
};

/// A bag, and one of its topics where `path` ends in ":/topic".
struct Source {
  std::filesystem::path bag;
  std::string topic;  ///< empty: not said
};

/// Nothing where `path` names no bag by the ending of its name, nor a folder of one.
[[nodiscard]] std::optional<Source> bag_source(const std::filesystem::path& path);
[[nodiscard]] bool is_bag(const std::filesystem::path& path);

/// The files of a bag, in the order in which they are read. Throws as open().
[[nodiscard]] std::vector<std::filesystem::path> files_of(const std::filesystem::path& bag);

/// Throws bad_input naming file and remedy: missing, empty, of another format, a folder without
/// bags, a compression that is not known. A file that is damaged further on is read up to there.
[[nodiscard]] std::unique_ptr<Reader> open(const std::filesystem::path& bag);

}  // namespace kinescope::bags
