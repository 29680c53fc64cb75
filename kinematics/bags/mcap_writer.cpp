// SPDX-License-Identifier: Apache-2.0
#include "kinematics/bags/mcap_writer.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <span>
#include <utility>

#include <zlib.h>
#include <zstd.h>

#include "kinematics/bags/mcap_format.h"
#include "kinematics/core/error.h"

namespace kinescope::bags {

std::uint32_t mcap_checksum(std::string_view bytes) {
  const auto* data = reinterpret_cast<const Bytef*>(bytes.data());  // NOLINT(*-reinterpret-cast)
  return static_cast<std::uint32_t>(crc32_z(0, data, bytes.size()));
}

namespace {

// Little-endian, whatever the machine is.
template <typename Number>
void put(std::string& out, Number value) {
  for (std::size_t byte = 0; byte < sizeof value; ++byte)
    out.push_back(static_cast<char>(static_cast<std::uint64_t>(value) >> (8U * byte) & 0xFFU));
}

void put_text(std::string& out, std::string_view text) {
  put(out, static_cast<std::uint32_t>(text.size()));
  out += text;
}

void put_record(std::string& out, McapRecord kind, std::string_view content) {
  put(out, static_cast<std::uint8_t>(kind));
  put(out, static_cast<std::uint64_t>(content.size()));
  out += content;
}

std::uint16_t id_of(std::size_t channel) { return static_cast<std::uint16_t>(channel + 1); }

// One a channel, under the channel's number.
std::string schema_record(const McapChannel& channel, std::uint16_t id) {
  std::string out;
  put(out, id);
  put_text(out, channel.schema_name);
  put_text(out, channel.schema_encoding);
  put_text(out, channel.schema);
  return out;
}

std::string channel_record(const McapChannel& channel, std::uint16_t id) {
  std::string out;
  put(out, id);
  put(out, id);
  put_text(out, channel.topic);
  put_text(out, channel.message_encoding);
  put(out, std::uint32_t{0});  // no metadata
  return out;
}

std::string packed_with_zstd(std::string_view bytes) {
  std::string out(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size =
      ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), ZSTD_CLEVEL_DEFAULT);
  KINESCOPE_CHECK(ZSTD_isError(size) == 0U, "zstd packs");
  out.resize(size);
  return out;
}

// First and last time of messages.
struct Span {
  std::uint64_t first_ns = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t last_ns = 0;
  void add(std::uint64_t time_ns) {
    first_ns = std::min(first_ns, time_ns);
    last_ns = std::max(last_ns, time_ns);
  }
  [[nodiscard]] std::uint64_t first() const { return first_ns > last_ns ? 0 : first_ns; }
};

// Writes from front to back.
class McapWriter {
 public:
  explicit McapWriter(const McapContent& content) : content_(content) {
    out_ += kMcapMagic;
    std::string header;
    put_text(header, "");  // no profile
    put_text(header, content.library);
    put_record(out_, McapRecord::kHeader, header);
    put_channels(records_);
  }

  void add(const McapMessage& message) {
    index_[message.channel].emplace_back(message.time_ns, records_.size());
    std::string record;
    put(record, id_of(message.channel));
    put(record, sequence_[message.channel]++);
    put(record, message.time_ns);
    put(record, message.time_ns);
    record += message.data;
    put_record(records_, McapRecord::kMessage, record);
    span_.add(message.time_ns);
    whole_.add(message.time_ns);
  }
  [[nodiscard]] std::size_t waiting() const { return records_.size(); }

  // The records that wait, as a chunk with its index behind it.
  void write_chunk() {
    if (records_.empty()) return;
    const std::string packed = packed_with_zstd(records_);
    const std::size_t start = out_.size();
    std::string chunk;
    put(chunk, span_.first());
    put(chunk, span_.last_ns);
    put(chunk, static_cast<std::uint64_t>(records_.size()));
    put(chunk, mcap_checksum(records_));
    put_text(chunk, "zstd");
    put(chunk, static_cast<std::uint64_t>(packed.size()));
    chunk += packed;
    put_record(out_, McapRecord::kChunk, chunk);
    const std::size_t end = out_.size();
    std::string offsets;
    for (const auto& [channel, entries] : index_) {
      put(offsets, id_of(channel));
      put(offsets, static_cast<std::uint64_t>(out_.size()));
      put_record(out_, McapRecord::kMessageIndex, message_index(channel, entries));
    }
    chunk_indexes_.push_back(chunk_index(start, end, offsets, packed.size()));
    records_.clear();
    index_.clear();
    span_ = {};
  }

  [[nodiscard]] std::string finish() {
    write_chunk();
    std::string data_end;
    put(data_end, mcap_checksum(out_));
    put_record(out_, McapRecord::kDataEnd, data_end);
    write_summary();
    out_ += kMcapMagic;
    return std::move(out_);
  }

 private:
  using Entries = std::vector<std::pair<std::uint64_t, std::size_t>>;  // time, place in the chunk

  void put_channels(std::string& out) const {
    for (std::size_t c = 0; c < content_.channels.size(); ++c) {
      put_record(out, McapRecord::kSchema, schema_record(content_.channels[c], id_of(c)));
      put_record(out, McapRecord::kChannel, channel_record(content_.channels[c], id_of(c)));
    }
  }

  static std::string message_index(std::size_t channel, const Entries& entries) {
    std::string out;
    put(out, id_of(channel));
    put(out, static_cast<std::uint32_t>(16 * entries.size()));
    for (const auto& [time_ns, place] : entries) {
      put(out, time_ns);
      put(out, static_cast<std::uint64_t>(place));
    }
    return out;
  }

  // Of the chunk that begins at `start`, its message indexes from `end` on.
  [[nodiscard]] std::string chunk_index(std::size_t start, std::size_t end,
                                        std::string_view offsets, std::size_t packed) const {
    std::string out;
    put(out, span_.first());
    put(out, span_.last_ns);
    put(out, static_cast<std::uint64_t>(start));
    put(out, static_cast<std::uint64_t>(end - start));
    put_text(out, offsets);
    put(out, static_cast<std::uint64_t>(out_.size() - end));
    put_text(out, "zstd");
    put(out, static_cast<std::uint64_t>(packed));
    put(out, static_cast<std::uint64_t>(records_.size()));
    return out;
  }

  [[nodiscard]] std::string statistics() const {
    const auto channels = content_.channels.size();
    std::string out;
    put(out, static_cast<std::uint64_t>(content_.messages.size()));
    put(out, static_cast<std::uint16_t>(channels));
    put(out, static_cast<std::uint32_t>(channels));
    put(out, std::uint32_t{0});  // attachments
    put(out, std::uint32_t{0});  // metadata
    put(out, static_cast<std::uint32_t>(chunk_indexes_.size()));
    put(out, whole_.first());
    put(out, whole_.last_ns);
    put(out, static_cast<std::uint32_t>(10 * sequence_.size()));
    for (const auto& [channel, count] : sequence_) {
      put(out, id_of(channel));
      put(out, std::uint64_t{count});
    }
    return out;
  }

  void write_summary() {
    const std::size_t start = out_.size();
    std::string offsets;
    const auto group = [&](McapRecord kind, const auto& write) {
      const std::size_t begin = out_.size();
      write();
      if (out_.size() == begin) return;
      std::string offset;
      put(offset, static_cast<std::uint8_t>(kind));
      put(offset, static_cast<std::uint64_t>(begin));
      put(offset, static_cast<std::uint64_t>(out_.size() - begin));
      put_record(offsets, McapRecord::kSummaryOffset, offset);
    };
    const auto& channels = content_.channels;
    group(McapRecord::kSchema, [&] {
      for (std::size_t c = 0; c < channels.size(); ++c)
        put_record(out_, McapRecord::kSchema, schema_record(channels[c], id_of(c)));
    });
    group(McapRecord::kChannel, [&] {
      for (std::size_t c = 0; c < channels.size(); ++c)
        put_record(out_, McapRecord::kChannel, channel_record(channels[c], id_of(c)));
    });
    group(McapRecord::kStatistics,
          [&] { put_record(out_, McapRecord::kStatistics, statistics()); });
    group(McapRecord::kChunkIndex, [&] {
      for (const std::string& index : chunk_indexes_)
        put_record(out_, McapRecord::kChunkIndex, index);
    });
    const std::size_t offsets_start = out_.size();
    out_ += offsets;
    write_footer(start, offsets_start);
  }

  // Its checksum is of the summary and of itself up to there.
  void write_footer(std::size_t summary, std::size_t offsets) {
    constexpr std::uint64_t kFooterBytes = 20;
    put(out_, static_cast<std::uint8_t>(McapRecord::kFooter));
    put(out_, kFooterBytes);
    put(out_, static_cast<std::uint64_t>(summary));
    put(out_, static_cast<std::uint64_t>(offsets));
    put(out_, mcap_checksum(std::string_view(out_).substr(summary)));
  }

  const McapContent& content_;
  std::string out_;
  std::string records_;  // of the chunk to come
  std::map<std::size_t, Entries> index_;
  std::map<std::size_t, std::uint32_t> sequence_;
  std::vector<std::string> chunk_indexes_;
  Span span_, whole_;
};

}  // namespace

std::string mcap_file(const McapContent& content, std::size_t chunk_bytes) {
  KINESCOPE_CHECK(content.channels.size() < std::numeric_limits<std::uint16_t>::max(),
                  "channels that 16 bits can number");
  std::vector<std::size_t> order(content.messages.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t m) { return content.messages[m].time_ns; });
  McapWriter writer(content);
  for (const std::size_t m : order) {
    if (writer.waiting() > chunk_bytes) writer.write_chunk();
    writer.add(content.messages[m]);
  }
  return writer.finish();
}

}  // namespace kinescope::bags
