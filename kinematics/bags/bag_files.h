// SPDX-License-Identifier: Apache-2.0
//
// The readers of single files, and what they share.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "kinematics/bags/bag.h"

namespace kinescope::bags {

/// How every message of a sqlite3 bag is packed.
enum class RowPacking { kNone, kZstd };

/// A file, and the name that messages have for it: that of the packed file it was unpacked from.
struct NamedFile {
  std::filesystem::path path;
  std::string name;
};

[[nodiscard]] std::unique_ptr<Reader> open_mcap(const NamedFile& file);
[[nodiscard]] std::unique_ptr<Reader> open_ros1(const NamedFile& file);
[[nodiscard]] std::unique_ptr<Reader> open_sqlite(const NamedFile& file, RowPacking packing);
/// A folder with metadata.yaml, or with bags alone: its files one after the other.
[[nodiscard]] std::unique_ptr<Reader> open_folder(const std::filesystem::path& folder);
[[nodiscard]] std::vector<std::filesystem::path> files_of_folder(
    const std::filesystem::path& folder);
/// One file by its ending. Those that are packed as a whole (.zstd) are unpacked beside the
/// system's temporary files.
[[nodiscard]] std::unique_ptr<Reader> open_file(const std::filesystem::path& file,
                                                RowPacking packing = RowPacking::kNone);
[[nodiscard]] bool is_bag_file(const std::filesystem::path& path);
[[nodiscard]] bool is_bag_folder(const std::filesystem::path& path);

/// "sensor_msgs/msg/JointState" as ROS 1 would name it.
[[nodiscard]] std::string plain_type(std::string_view type);
[[nodiscard]] Encoding encoding_of(std::string_view name);

/// Topics by the number that a file gives them. Two publishers of one topic are one topic.
class TopicTable {
 public:
  void add(std::uint32_t number, Topic topic);
  [[nodiscard]] std::optional<std::size_t> index_of(std::uint32_t number) const;
  [[nodiscard]] const std::vector<Topic>& topics() const { return topics_; }

 private:
  std::vector<Topic> topics_;
  std::map<std::uint32_t, std::size_t> numbers_;
  std::map<std::tuple<std::string, std::string, std::string>, std::size_t> names_;
};

/// A record says that it is longer than what holds it.
struct CutOff {};

/// Little-endian numbers and strings from bytes that somebody else owns. Throws CutOff.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}
  [[nodiscard]] bool empty() const { return bytes_.empty(); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  std::uint8_t u8() { return static_cast<std::uint8_t>(number(1)); }
  std::uint16_t u16() { return static_cast<std::uint16_t>(number(2)); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(number(4)); }
  std::uint64_t u64() { return number(8); }
  /// Bytes behind their length in 32 bits.
  std::string_view string() { return take(u32()); }
  std::string_view take(std::uint64_t size);
  std::string_view rest() { return take(bytes_.size()); }

 private:
  std::uint64_t number(std::size_t size);
  std::string_view bytes_;
};

/// A file from front to back.
class InputFile {
 public:
  explicit InputFile(const NamedFile& file);
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::uint64_t position() const { return position_; }
  [[nodiscard]] std::uint64_t left() const { return size_ - position_; }
  /// The next bytes. Throws CutOff where there are fewer.
  std::string read(std::uint64_t size);
  void skip(std::uint64_t size);

 private:
  std::ifstream stream_;
  std::string name_;
  std::uint64_t size_ = 0;
  std::uint64_t position_ = 0;
};

}  // namespace kinescope::bags
