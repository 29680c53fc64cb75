// SPDX-License-Identifier: Apache-2.0
#include "kinematics/bags/chunked_file.h"

#include <utility>

#include <fmt/format.h>

#include "kinematics/bags/unpack.h"
#include "kinematics/core/error.h"

namespace kinescope::bags {

bool ChunkedFile::begins_with(std::string_view magic) {
  return file_.left() >= magic.size() && file_.read(magic.size()) == magic;
}

std::optional<Message> ChunkedFile::next() {
  while (!records_.empty() || !finished_) {
    std::optional<Message> message;
    if (records_.empty()) {
      message = next_of_file();
    } else {
      try {
        ByteReader reader(records_);
        message = next_of_chunk(reader);
        records_ = reader.rest();
      } catch (const CutOff&) {
        // What is cut off inside of a chunk was said when the chunk was unpacked.
        if (chunk_whole_) warn(fmt::format("a damaged record in the chunk at byte {}", chunk_at_));
        records_ = {};
      }
    }
    if (message) return message;
  }
  return std::nullopt;
}

bool ChunkedFile::open_chunk(const std::string& packing, std::string_view packed,
                             std::uint64_t size, std::uint64_t start, bool cut,
                             std::string_view remedy) {
  const auto known = packing_named(packing);
  if (!known)
    throw bad_input(file_.name(), fmt::format("chunks packed with '{}'", packing), remedy);
  Unpacked chunk = unpack(*known, packed, size);
  if (cut) {
    warn(fmt::format("the file ends early, inside of the chunk at byte {}", start));
  } else if (!chunk.whole) {
    warn(fmt::format("the chunk at byte {} is damaged: what stands before it is read", start));
  }
  chunk_ = std::move(chunk.bytes);
  records_ = chunk_;
  chunk_at_ = start;
  chunk_whole_ = chunk.whole;
  return chunk_whole_;
}

void ChunkedFile::warn(const std::string& what) {
  warnings_.push_back(fmt::format("{}: {}", file_.name(), what));
}

void ChunkedFile::warn_of_cut(std::uint64_t start) {
  warn(fmt::format("the file ends early, inside of the record at byte {}", start));
}

}  // namespace kinescope::bags
