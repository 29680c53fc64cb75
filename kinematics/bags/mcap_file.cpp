// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "kinematics/bags/chunked_file.h"
#include "kinematics/bags/mcap_format.h"
#include "kinematics/core/error.h"

namespace kinescope::bags {
namespace {

bool is_read(McapRecord kind) {
  return kind == McapRecord::kSchema || kind == McapRecord::kChannel ||
         kind == McapRecord::kMessage || kind == McapRecord::kChunk;
}

class McapFile final : public ChunkedFile {
 public:
  explicit McapFile(const NamedFile& file) : ChunkedFile(file) {
    if (!begins_with(kMcapMagic))
      throw bad_input(file_.name(), "is no MCAP file", "check what it is, or copy it again");
  }

 private:
  std::optional<Message> next_of_chunk(ByteReader& records) override {
    const auto kind = static_cast<McapRecord>(records.u8());
    const std::string_view content = records.take(records.u64());
    return kind == McapRecord::kChunk ? std::nullopt : read(kind, content);
  }

  std::optional<Message> next_of_file() override {
    const std::uint64_t start = file_.position();
    if (file_.left() == 0) {
      end();
      warn("the file ends early, without a summary: its recorder was stopped");
      return std::nullopt;
    }
    try {
      const std::string head = file_.read(9);
      ByteReader reader(head);
      const auto kind = static_cast<McapRecord>(reader.u8());
      const std::uint64_t size = reader.u64();
      if (kind == McapRecord::kDataEnd || kind == McapRecord::kFooter) {
        end();
        return std::nullopt;
      }
      if (!is_read(kind)) {
        file_.skip(size);
        return std::nullopt;
      }
      const bool cut = size > file_.left();
      if (cut && kind != McapRecord::kChunk) throw CutOff{};
      record_ = file_.read(cut ? file_.left() : size);
      if (cut) finished_ = true;
      doubtful_ = false;
      if (kind != McapRecord::kChunk) return read(kind, record_);
      read_chunk(start, cut);
    } catch (const CutOff&) {
      end();
      warn_of_cut(start);
    }
    return std::nullopt;
  }

  /// A schema, a channel or a message.
  std::optional<Message> read(McapRecord kind, std::string_view content) {
    ByteReader reader(content);
    if (kind == McapRecord::kSchema) {
      const std::uint16_t id = reader.u16();
      schemas_.try_emplace(id, reader.string());
    } else if (kind == McapRecord::kChannel) {
      const std::uint16_t id = reader.u16();
      const auto schema = schemas_.find(reader.u16());
      const std::string name(reader.string());
      const std::string encoding(reader.string());
      const std::string type = schema == schemas_.end() ? "" : plain_type(schema->second);
      table_.add(id, {name, type, encoding, encoding_of(encoding)});
    } else if (kind == McapRecord::kMessage && !doubtful_) {
      const auto topic = table_.index_of(reader.u16());
      static_cast<void>(reader.u32());  // its number in the channel
      const auto received_ns = static_cast<std::int64_t>(reader.u64());
      static_cast<void>(reader.u64());  // when it was published
      if (topic) return Message{*topic, received_ns, reader.rest()};
      ++unnamed_;
    }
    return std::nullopt;
  }

  void read_chunk(std::uint64_t start, bool cut) {
    ByteReader reader(record_);
    static_cast<void>(reader.u64());  // stamps of its first and last message
    static_cast<void>(reader.u64());
    const std::uint64_t size = reader.u64();
    const std::uint32_t crc = reader.u32();
    const std::string packing(reader.string());
    const std::uint64_t packed_size = reader.u64();
    // Of a cut chunk as much as there is, and no more than that of one with a wrong length.
    const std::string_view packed =
        reader.take(std::min<std::uint64_t>(packed_size, reader.size()));
    const bool whole = open_chunk(packing, packed, size, start, cut,
                                  "zstd, lz4 and none are read: mcap compress --compression zstd");
    doubtful_ = whole && crc != 0 && mcap_checksum(chunk()) != crc;
    if (doubtful_ && !cut)
      warn(fmt::format("the chunk at byte {} is damaged (checksum) and left out", start));
  }

  void end() {
    finished_ = true;
    if (unnamed_ > 0)
      warn(fmt::format("{} messages are left out whose topic stood in a damaged chunk", unnamed_));
  }

  std::map<std::uint16_t, std::string> schemas_;
  // Of the chunk only what names topics is believed: it is written once, and all that follows needs
  // it.
  bool doubtful_ = false;
};

}  // namespace

std::unique_ptr<Reader> open_mcap(const NamedFile& file) {
  return std::make_unique<McapFile>(file);
}

}  // namespace kinescope::bags
