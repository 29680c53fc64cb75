// SPDX-License-Identifier: Apache-2.0
//
// What MCAP and ROS 1 share: records one after the other, some of which hold packed records.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/bags/bag_files.h"

namespace kinescope::bags {

class ChunkedFile : public Reader {
 public:
  [[nodiscard]] const std::vector<Topic>& topics() const final { return table_.topics(); }
  [[nodiscard]] const std::vector<std::string>& warnings() const final { return warnings_; }
  [[nodiscard]] std::optional<Message> next() final;

 protected:
  explicit ChunkedFile(const NamedFile& file) : file_(file) {}

  [[nodiscard]] bool begins_with(std::string_view magic);
  /// Deals with the next record of the file, which may be a message, or finishes.
  virtual std::optional<Message> next_of_file() = 0;
  /// Takes the next record of a chunk. Throws CutOff.
  virtual std::optional<Message> next_of_chunk(ByteReader& records) = 0;

  /// Unpacks the chunk whose record begins at `start`, as far as that goes: true where it is whole.
  /// `cut`: the file ends in it. Throws bad_input with `remedy` for a packing that is not known.
  bool open_chunk(const std::string& packing, std::string_view packed, std::uint64_t size,
                  std::uint64_t start, bool cut, std::string_view remedy);
  [[nodiscard]] std::string_view chunk() const { return chunk_; }
  void warn(const std::string& what);
  void warn_of_cut(std::uint64_t start);

  InputFile file_;
  TopicTable table_;
  std::string record_;  // of the file
  bool finished_ = false;
  std::uint64_t unnamed_ = 0;  // messages of a topic that was not declared

 private:
  std::string chunk_;         // unpacked
  std::string_view records_;  // of the chunk, those to come
  std::uint64_t chunk_at_ = 0;
  bool chunk_whole_ = false;
  std::vector<std::string> warnings_;
};

}  // namespace kinescope::bags
