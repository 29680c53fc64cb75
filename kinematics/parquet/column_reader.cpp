// SPDX-License-Identifier: Apache-2.0
#include "kinematics/parquet/column_reader.h"

#include <bit>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "kinematics/parquet/damage.h"
#include "kinematics/parquet/encodings.h"
#include "kinematics/parquet/unpack_page.h"

namespace kinescope::parquet {
namespace {

/// What a page's values stand in, and the levels that say where.
struct Page {
  std::vector<std::uint32_t> defined, repeated;  ///< empty: all values are there, one a row
  std::string bytes;                             ///< unpacked
  std::size_t values_at = 0;                     ///< in `bytes`
  std::string_view values() const { return std::string_view(bytes).substr(values_at); }
};

std::vector<std::uint32_t> levels_of(std::string_view bytes, int most, std::size_t count) {
  const auto highest = static_cast<std::uint32_t>(most);
  std::vector<std::uint32_t> out =
      hybrid_numbers(bytes, static_cast<unsigned>(std::bit_width(highest)), count);
  for (const std::uint32_t level : out)
    if (level > highest) throw Damage{"a page has a level that its schema has not"};
  return out;
}

/// Version 1: levels stand in front of the values, each behind its length, packed with them.
Page page_of_version_1(std::string_view packed, const PageHeader& header, const Leaf& leaf,
                       Codec codec) {
  Page out;
  out.bytes = unpack_page(codec, packed, header.unpacked_size);
  const auto take_levels = [&](int most) -> std::vector<std::uint32_t> {
    if (most == 0) return {};
    constexpr std::size_t kLength = 4;
    const std::uint64_t size = little_endian(out.values(), kLength);
    out.values_at += kLength;
    if (size > out.values().size()) throw Damage{"a page's levels go on beyond its end"};
    auto levels = levels_of(out.values().substr(0, size), most, header.values);
    out.values_at += static_cast<std::size_t>(size);
    return levels;
  };
  out.repeated = take_levels(leaf.most_repeated);
  out.defined = take_levels(leaf.most_defined);
  return out;
}

/// Version 2: levels are never packed, and their lengths stand in the page's header.
Page page_of_version_2(std::string_view packed, const PageHeader& header, const Leaf& leaf,
                       Codec codec) {
  const std::size_t levels = header.repeated_size + header.defined_size;
  if (levels > packed.size() || levels > header.unpacked_size)
    throw Damage{"a page's levels go on beyond its end"};
  Page out;
  if (leaf.most_repeated > 0) {
    out.repeated =
        levels_of(packed.substr(0, header.repeated_size), leaf.most_repeated, header.values);
  }
  if (leaf.most_defined > 0) {
    out.defined = levels_of(packed.substr(header.repeated_size, header.defined_size),
                            leaf.most_defined, header.values);
  }
  packed.remove_prefix(levels);
  const std::size_t size = header.unpacked_size - levels;
  // A page without a value may have nothing to unpack.
  if (packed.empty() && size == 0) return out;
  out.bytes = unpack_page(header.is_packed ? codec : Codec::kNone, packed, size);
  return out;
}

double none_of(const Numbers&) { return std::numeric_limits<double>::quiet_NaN(); }
std::string none_of(const Texts&) { return {}; }

std::vector<double> decode(const Numbers&, std::string_view bytes, const Leaf& leaf,
                           Encoding encoding, std::size_t count) {
  return decode_numbers(bytes, leaf, encoding, count);
}
std::vector<std::string_view> decode(const Texts&, std::string_view bytes, const Leaf& leaf,
                                     Encoding encoding, std::size_t count) {
  return decode_texts(bytes, leaf, encoding, count);
}

// Runs and dictionaries stand for more than they take: the most that is made of them. A column of
// twelve joints has so many values in a day at 30 Hz; writers begin a new file long before.
constexpr std::size_t kMostValues = std::size_t{1} << 25U;
constexpr std::size_t kMostPageValues = std::size_t{1} << 23U;
constexpr std::size_t kMostTextBytes = std::size_t{1} << 28U;

template <typename Value>
class ChunkReader {
 public:
  ChunkReader(const Leaf& leaf, const Chunk& chunk, Values<Value>& out)
      : leaf_(leaf), chunk_(chunk), out_(out), first_row_(out.rows()) {}

  void read(std::string_view bytes, std::uint64_t rows) {
    while (!bytes.empty() && read_ < chunk_.values) {
      const PageHeader header = read_page_header(bytes);
      bytes.remove_prefix(header.header_size);
      if (header.packed_size > bytes.size()) throw Damage{"a page goes on beyond its column"};
      add_page(bytes.substr(0, header.packed_size), header);
      bytes.remove_prefix(header.packed_size);
    }
    if (read_ != chunk_.values || out_.rows() - first_row_ != rows)
      throw Damage{fmt::format("it declares {} values in {} rows, its pages have {} in {}",
                               chunk_.values, rows, read_, out_.rows() - first_row_)};
  }

 private:
  void add_page(std::string_view packed, const PageHeader& header) {
    if (header.type == PageType::kIndex) return;
    if (header.values > kMostPageValues) throw NotRead{"a page of more than 8 million values"};
    if (header.type == PageType::kDictionary) {
      if (dictionary_) throw Damage{"it has two dictionaries"};
      const std::string bytes = unpack_page(chunk_.codec, packed, header.unpacked_size);
      // Plain, whichever of its two names the writer gives it.
      const auto read = decode(out_, bytes, leaf_, Encoding::kPlain, header.values);
      dictionary_.emplace(read.begin(), read.end());
      return;
    }
    if (header.values > chunk_.values - read_)
      throw Damage{"its pages have more values than it declares"};
    const bool second = header.type == PageType::kDataV2;
    const Page page = second ? page_of_version_2(packed, header, leaf_, chunk_.codec)
                             : page_of_version_1(packed, header, leaf_, chunk_.codec);
    add_rows(page, header.values, values_of(page, header));
    read_ += header.values;
  }

  [[nodiscard]] bool is_there(const Page& page, std::size_t i) const {
    return page.defined.empty() ||
           page.defined[i] == static_cast<std::uint32_t>(leaf_.most_defined);
  }

  std::vector<Value> values_of(const Page& page, const PageHeader& header) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < header.values; ++i) count += is_there(page, i) ? 1U : 0U;
    const bool by_dictionary = header.encoding == Encoding::kPlainDictionary ||
                               header.encoding == Encoding::kRleDictionary;
    if (by_dictionary) return from_dictionary(page.values(), count);
    const auto read = decode(out_, page.values(), leaf_, header.encoding, count);
    return {read.begin(), read.end()};
  }

  std::vector<Value> from_dictionary(std::string_view bytes, std::size_t count) {
    std::vector<Value> out;
    if (count == 0) return out;
    if (!dictionary_) throw Damage{"its dictionary is missing"};
    const auto width = static_cast<unsigned>(little_endian(bytes, 1));
    out.reserve(count);
    for (const std::uint32_t index : hybrid_numbers(bytes.substr(1), width, count)) {
      if (index >= dictionary_->size()) throw Damage{"a value is not in its dictionary"};
      count_bytes((*dictionary_)[index]);
      out.push_back((*dictionary_)[index]);
    }
    return out;
  }

  void count_bytes(const Value& value) {
    if constexpr (std::is_same_v<Value, std::string>) {
      text_bytes_ += value.size();
      if (text_bytes_ > kMostTextBytes) throw NotRead{"texts of more than 256 MiB"};
    }
  }

  void add_rows(const Page& page, std::size_t count, std::vector<Value> values) {
    if (count > kMostValues - out_.values.size() || count > kMostValues - out_.rows())
      throw NotRead{"a column of more than 33 million values"};
    std::size_t next = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const bool begins = page.repeated.empty() || page.repeated[i] == 0;
      if (begins) {
        out_.ends.push_back(out_.values.size());
      } else if (out_.rows() == first_row_) {
        throw Damage{"its first value goes on with a row that there is not"};
      }
      const bool in_list = leaf_.most_repeated == 0 || page.defined.empty() ||
                           page.defined[i] >= static_cast<std::uint32_t>(leaf_.in_list);
      if (!in_list) continue;
      out_.values.push_back(is_there(page, i) ? std::move(values[next++]) : none_of(out_));
      ++out_.ends.back();
    }
  }

  const Leaf& leaf_;
  const Chunk& chunk_;
  Values<Value>& out_;
  std::size_t first_row_;
  std::size_t text_bytes_ = 0;
  std::uint64_t read_ = 0;  // values
  std::optional<std::vector<Value>> dictionary_;
};

}  // namespace

void append_chunk(std::string_view bytes, const Leaf& leaf, const Chunk& chunk, std::uint64_t rows,
                  Numbers& out) {
  ChunkReader<double>(leaf, chunk, out).read(bytes, rows);
}

void append_chunk(std::string_view bytes, const Leaf& leaf, const Chunk& chunk, std::uint64_t rows,
                  Texts& out) {
  ChunkReader<std::string>(leaf, chunk, out).read(bytes, rows);
}

}  // namespace kinescope::parquet
