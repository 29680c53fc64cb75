// SPDX-License-Identifier: Apache-2.0
#include <map>

#include "kinematics/bags/chunked_file.h"
#include "kinematics/core/error.h"

namespace kinescope::bags {
namespace {

constexpr std::string_view kBagMagic = "#ROSBAG V2.0\n";

/// The field `op` of a record's header.
enum class BagRecord : std::uint8_t {
  kMessage = 0x02,
  kBagHeader = 0x03,
  kIndex = 0x04,
  kChunk = 0x05,
  kChunkInfo = 0x06,
  kConnection = 0x07
};

using Fields = std::map<std::string, std::string, std::less<>>;

/// "name=value" behind their lengths.
Fields read_fields(std::string_view bytes) {
  Fields fields;
  ByteReader reader(bytes);
  while (!reader.empty()) {
    const std::string_view field = reader.string();
    const std::size_t equals = field.find('=');
    if (equals == std::string_view::npos) throw CutOff{};
    fields.insert_or_assign(std::string(field.substr(0, equals)),
                            std::string(field.substr(equals + 1)));
  }
  return fields;
}

std::string_view field(const Fields& fields, std::string_view name) {
  const auto found = fields.find(name);
  if (found == fields.end()) throw CutOff{};
  return found->second;
}

BagRecord kind_of(const Fields& fields) {
  return static_cast<BagRecord>(ByteReader(field(fields, "op")).u8());
}

std::int64_t time_ns(std::string_view bytes) {
  ByteReader reader(bytes);
  const std::int64_t seconds = reader.u32();
  return seconds * 1'000'000'000 + reader.u32();
}

class Ros1File final : public ChunkedFile {
 public:
  explicit Ros1File(const NamedFile& file) : ChunkedFile(file) {
    if (!begins_with(kBagMagic)) {
      throw bad_input(file_.name(), "is no bag of ROS 1 (format 2.0)",
                      "check what it is; a bag of format 1.2 is brought to 2.0 by rosbag fix");
    }
  }

 private:
  std::optional<Message> next_of_chunk(ByteReader& records) override {
    const Fields fields = read_fields(records.string());
    return read(fields, records.string());
  }

  std::uint32_t length() {
    const std::string bytes = file_.read(4);
    return ByteReader(bytes).u32();
  }

  std::optional<Message> next_of_file() override {
    const std::uint64_t start = file_.position();
    if (file_.left() == 0) {
      finished_ = true;
      return std::nullopt;
    }
    try {
      const std::string head = file_.read(length());
      const Fields fields = read_fields(head);
      const std::uint32_t size = length();
      const BagRecord kind = kind_of(fields);
      if (kind == BagRecord::kBagHeader || kind == BagRecord::kIndex ||
          kind == BagRecord::kChunkInfo) {
        file_.skip(size);
        return std::nullopt;
      }
      const bool cut = size > file_.left();
      if (cut && kind != BagRecord::kChunk) throw CutOff{};
      record_ = file_.read(cut ? file_.left() : size);
      if (cut) finished_ = true;
      if (kind != BagRecord::kChunk) return read(fields, record_);
      open_chunk(std::string(field(fields, "compression")), record_,
                 ByteReader(field(fields, "size")).u32(), start, cut,
                 "none, bz2 and lz4 are read: rosbag decompress");
    } catch (const CutOff&) {
      finished_ = true;
      warn_of_cut(start);
    }
    return std::nullopt;
  }

  /// A connection or a message.
  std::optional<Message> read(const Fields& fields, std::string_view data) {
    const BagRecord kind = kind_of(fields);
    if (kind == BagRecord::kConnection) {
      const std::uint32_t id = ByteReader(field(fields, "conn")).u32();
      const Fields said = read_fields(data);
      table_.add(id, {std::string(field(fields, "topic")), plain_type(field(said, "type")), "ros1",
                      Encoding::kRos1});
    } else if (kind == BagRecord::kMessage) {
      const auto topic = table_.index_of(ByteReader(field(fields, "conn")).u32());
      if (topic) return Message{*topic, time_ns(field(fields, "time")), data};
      if (unnamed_++ == 0) warn("messages are left out whose connection stood in a damaged chunk");
    }
    return std::nullopt;
  }
};

}  // namespace

std::unique_ptr<Reader> open_ros1(const NamedFile& file) {
  return std::make_unique<Ros1File>(file);
}

}  // namespace kinescope::bags
