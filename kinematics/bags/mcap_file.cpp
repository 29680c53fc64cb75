// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <zlib.h>

#include "kinematics/bags/bag_files.h"
#include "kinematics/bags/unpack.h"
#include "kinematics/core/error.h"

namespace kinescope::bags {
namespace {

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);

/// Opcodes of https://mcap.dev/spec; those that are not named here are passed over.
enum class Record : std::uint8_t {
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kDataEnd = 0x0F
};

bool is_read(Record kind) {
  return kind == Record::kSchema || kind == Record::kChannel || kind == Record::kMessage ||
         kind == Record::kChunk;
}

std::uint32_t checksum(std::string_view bytes) {
  const auto* data = reinterpret_cast<const Bytef*>(bytes.data());  // NOLINT(*-reinterpret-cast)
  return static_cast<std::uint32_t>(crc32_z(0, data, bytes.size()));
}

class McapFile final : public Reader {
 public:
  explicit McapFile(const NamedFile& file) : file_(file) {
    if (file_.left() < kMagic.size() || file_.read(kMagic.size()) != kMagic) {
      throw bad_input(file_.name(), "is no MCAP file", "check what it is, or copy it again");
    }
  }

  const std::vector<Topic>& topics() const override { return table_.topics(); }
  const std::vector<std::string>& warnings() const override { return warnings_; }

  std::optional<Message> next() override {
    while (true) {
      if (!records_.empty()) {
        if (auto message = next_of_chunk()) return message;
      } else if (finished_) {
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
      const auto kind = static_cast<Record>(reader.u8());
      const std::string_view content = reader.take(reader.u64());
      records_ = reader.rest();
      return kind == Record::kChunk ? std::nullopt : read(kind, content);
    } catch (const CutOff&) {
      // What is cut off inside of a chunk was said when the chunk was unpacked.
      if (!chunk_cut_) warn(fmt::format("a damaged record in the chunk at byte {}", chunk_at_));
      records_ = {};
      return std::nullopt;
    }
  }

  std::optional<Message> next_of_file() {
    const std::uint64_t start = file_.position();
    if (file_.left() == 0) return end("without a summary: its recorder was stopped");
    try {
      const std::string head = file_.read(9);
      ByteReader reader(head);
      const auto kind = static_cast<Record>(reader.u8());
      const std::uint64_t size = reader.u64();
      if (kind == Record::kDataEnd || kind == Record::kFooter) {
        finished_ = true;
        warn_of_unnamed();
        return std::nullopt;
      }
      if (!is_read(kind)) {
        file_.skip(size);
        return std::nullopt;
      }
      const bool cut = size > file_.left();
      if (cut && kind != Record::kChunk) throw CutOff{};
      record_ = file_.read(cut ? file_.left() : size);
      if (cut) finished_ = true;
      doubtful_ = false;
      if (kind != Record::kChunk) return read(kind, record_);
      open_chunk(record_, start, cut);
      return std::nullopt;
    } catch (const CutOff&) {
      return end(fmt::format("inside of the record at byte {}", start));
    }
  }

  /// A schema, a channel or a message.
  std::optional<Message> read(Record kind, std::string_view content) {
    ByteReader reader(content);
    if (kind == Record::kSchema) {
      const std::uint16_t id = reader.u16();
      schemas_.try_emplace(id, reader.string());
    } else if (kind == Record::kChannel) {
      const std::uint16_t id = reader.u16();
      const auto schema = schemas_.find(reader.u16());
      const std::string name(reader.string());
      const std::string encoding(reader.string());
      const std::string type = schema == schemas_.end() ? "" : plain_type(schema->second);
      table_.add(id, {name, type, encoding, encoding_of(encoding)});
    } else if (kind == Record::kMessage && !doubtful_) {
      const auto topic = table_.index_of(reader.u16());
      static_cast<void>(reader.u32());  // its number in the channel
      const auto received_ns = static_cast<std::int64_t>(reader.u64());
      static_cast<void>(reader.u64());  // when it was published
      if (topic) return Message{*topic, received_ns, reader.rest()};
      ++unnamed_;
    }
    return std::nullopt;
  }

  void open_chunk(std::string_view content, std::uint64_t start, bool cut) {
    ByteReader reader(content);
    static_cast<void>(reader.u64());  // stamps of its first and last message
    static_cast<void>(reader.u64());
    const std::uint64_t size = reader.u64();
    const std::uint32_t crc = reader.u32();
    const std::string packing(reader.string());
    const std::uint64_t packed_size = reader.u64();
    // Of a cut chunk as much as there is, and no more than that of one with a wrong length.
    const std::string_view packed =
        reader.take(std::min<std::uint64_t>(packed_size, reader.size()));
    const auto known = packing_named(packing);
    if (!known) {
      throw bad_input(file_.name(), fmt::format("chunks packed with '{}'", packing),
                      "zstd, lz4 and none are read: mcap compress --compression zstd");
    }
    Unpacked chunk = unpack(*known, packed, size);
    chunk_at_ = start;
    chunk_cut_ = !chunk.whole;
    if (cut) {
      warn(fmt::format("the file ends early, inside of the chunk at byte {}", start));
    } else if (!chunk.whole) {
      warn(fmt::format("the chunk at byte {} is damaged: what stands before it is read", start));
    } else if (crc != 0 && checksum(chunk.bytes) != crc) {
      warn(fmt::format("the chunk at byte {} is damaged (checksum) and left out", start));
    }
    doubtful_ = chunk.whole && crc != 0 && checksum(chunk.bytes) != crc;
    chunk_ = std::move(chunk.bytes);
    records_ = chunk_;
  }

  void warn_of_unnamed() {
    if (unnamed_ > 0)
      warn(fmt::format("{} messages are left out whose topic stood in a damaged chunk", unnamed_));
  }

  std::optional<Message> end(const std::string& where) {
    finished_ = true;
    warn_of_unnamed();
    warn(fmt::format("the file ends early, {}", where));
    return std::nullopt;
  }

  void warn(const std::string& what) {
    warnings_.push_back(fmt::format("{}: {}", file_.name(), what));
  }

  InputFile file_;
  TopicTable table_;
  std::map<std::uint16_t, std::string> schemas_;
  std::string record_;        // of the file
  std::string chunk_;         // unpacked
  std::string_view records_;  // of the chunk, those to come
  std::uint64_t chunk_at_ = 0;
  bool chunk_cut_ = false;
  // Of the chunk only what names topics is believed: it is written once, and all that follows needs
  // it.
  bool doubtful_ = false;
  bool finished_ = false;
  std::uint64_t unnamed_ = 0;  // messages of a channel that was not declared
  std::vector<std::string> warnings_;
};

}  // namespace

std::unique_ptr<Reader> open_mcap(const NamedFile& file) {
  return std::make_unique<McapFile>(file);
}

}  // namespace kinescope::bags
