// SPDX-License-Identifier: Apache-2.0
#include <map>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bags/bag_files.h"
#include "kinematics/bags/unpack.h"
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

class Ros1File final : public Reader {
 public:
  explicit Ros1File(const NamedFile& file) : file_(file) {
    if (file_.left() < kBagMagic.size() || file_.read(kBagMagic.size()) != kBagMagic) {
      throw bad_input(file_.name(), "is no bag of ROS 1 (format 2.0)",
                      "check what it is; a bag of format 1.2 is brought to 2.0 by rosbag fix");
    }
  }

  const std::vector<Topic>& topics() const override { return table_.topics(); }
  const std::vector<std::string>& warnings() const override { return warnings_; }

  std::optional<Message> next() override {
    while (true) {
      if (!records_.empty()) {
        if (auto message = next_of_chunk()) return message;
      } else if (finished_ || file_.left() == 0) {
        return std::nullopt;
      } else if (auto message = next_of_file()) {
        return message;
      }
    }
  }

 private:
  std::optional<Message> next_of_chunk() {
    try {
      ByteReader reader(records_);
      const Fields fields = read_fields(reader.string());
      const std::string_view data = reader.string();
      records_ = reader.rest();
      return read(fields, data);
    } catch (const CutOff&) {
      // What is cut off inside of a chunk was said when the chunk was unpacked.
      if (!chunk_cut_) warn(fmt::format("a damaged record in the chunk at byte {}", chunk_at_));
      records_ = {};
      return std::nullopt;
    }
  }

  std::uint32_t length() {
    const std::string bytes = file_.read(4);
    return ByteReader(bytes).u32();
  }

  std::optional<Message> next_of_file() {
    const std::uint64_t start = file_.position();
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
      open_chunk(fields, start, cut);
    } catch (const CutOff&) {
      finished_ = true;
      warn(fmt::format("the file ends early, inside of the record at byte {}", start));
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

  void open_chunk(const Fields& fields, std::uint64_t start, bool cut) {
    const std::string packing(field(fields, "compression"));
    const auto known = packing_named(packing);
    if (!known) {
      throw bad_input(file_.name(), fmt::format("chunks packed with '{}'", packing),
                      "none, bz2 and lz4 are read: rosbag decompress");
    }
    Unpacked chunk = unpack(*known, record_, ByteReader(field(fields, "size")).u32());
    chunk_at_ = start;
    chunk_cut_ = !chunk.whole;
    if (cut) {
      warn(fmt::format("the file ends early, inside of the chunk at byte {}", start));
    } else if (!chunk.whole) {
      warn(fmt::format("the chunk at byte {} is damaged: what stands before it is read", start));
    }
    chunk_ = std::move(chunk.bytes);
    records_ = chunk_;
  }

  void warn(const std::string& what) {
    warnings_.push_back(fmt::format("{}: {}", file_.name(), what));
  }

  InputFile file_;
  TopicTable table_;
  std::string record_;        // of the file
  std::string chunk_;         // unpacked
  std::string_view records_;  // of the chunk, those to come
  std::uint64_t chunk_at_ = 0;
  bool chunk_cut_ = false;
  bool finished_ = false;
  std::uint64_t unnamed_ = 0;  // messages of a connection that was not declared
  std::vector<std::string> warnings_;
};

}  // namespace

std::unique_ptr<Reader> open_ros1(const NamedFile& file) {
  return std::make_unique<Ros1File>(file);
}

}  // namespace kinescope::bags
