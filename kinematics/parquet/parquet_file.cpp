// SPDX-License-Identifier: Apache-2.0
#include "kinematics/parquet/parquet_file.h"

#include <algorithm>
#include <fstream>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"
#include "kinematics/parquet/column_reader.h"
#include "kinematics/parquet/damage.h"
#include "kinematics/parquet/encodings.h"
#include "kinematics/parquet/file_layout.h"

namespace kinescope::parquet {
namespace fs = std::filesystem;
namespace {

constexpr std::string_view kMagic = "PAR1";
constexpr std::string_view kEncryptedMagic = "PARE";
/// Metadata of more than this is of no log: a row group an episode takes some kB.
constexpr std::uint64_t kLargestFooter = std::uint64_t{1} << 27U;

Error damaged(const std::string& place, const Damage& damage) {
  return bad_input(place, fmt::format("the file is damaged: {}", damage.what),
                   "copy or write it again");
}

Error not_read(const std::string& place, const NotRead& reason) {
  return bad_input(place, fmt::format("{} is not read", reason.what),
                   "write the file again as pyarrow does by default");
}

/// `read()`, with what is wrong said of a file.
template <typename Read>
auto with_place(const std::string& place, const Read& read) {
  try {
    return read();
  } catch (const Damage& damage) {
    throw damaged(place, damage);
  } catch (const NotRead& reason) {
    throw not_read(place, reason);
  }
}

std::uint64_t size_of_file(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw bad_input(path.string(), "no such file", "copy it again");
  if (!fs::is_regular_file(status)) throw bad_input(path.string(), "is no file", "copy it again");
  const std::uint64_t size = fs::file_size(path, error);
  if (error) throw bad_input(path.string(), "cannot be read", "check its permissions");
  return size;
}

std::string read_part(const fs::path& path, std::uint64_t begin, std::uint64_t size) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw bad_input(path.string(), "may not be read", "check its permissions");
  std::string out(static_cast<std::size_t>(size), '\0');
  stream.seekg(static_cast<std::streamoff>(begin));
  stream.read(out.data(), static_cast<std::streamsize>(size));
  if (!stream) throw Damage{"it ends early"};
  return out;
}

Layout layout_of(const fs::path& path, std::uint64_t file_size) {
  constexpr std::uint64_t kTail = 8;  // length of the metadata, magic
  if (file_size == 0) throw Damage{"it is empty"};
  if (file_size < kMagic.size() + kTail) throw Damage{"it is too short"};
  const std::string head = read_part(path, 0, kMagic.size());
  const std::string tail = read_part(path, file_size - kTail, kTail);
  if (head == kEncryptedMagic) throw NotRead{"encryption"};
  if (head != kMagic) throw Damage{"it does not begin as a Parquet file does"};
  if (!tail.ends_with(kMagic))
    throw Damage{"it is cut off, or its writer was killed before it wrote the metadata"};
  const std::uint64_t size = little_endian(tail, 4);
  if (size > file_size - kTail - kMagic.size() || size > kLargestFooter)
    throw Damage{"its metadata is longer than the file"};
  return read_layout(read_part(path, file_size - kTail - size, size), file_size);
}

Column column_of(const Leaf& leaf) {
  Column out{leaf.name, Kind::kNumbers, leaf.most_repeated > 0};
  if (leaf.type == Physical::kByteArray || leaf.type == Physical::kFixedBytes)
    out.kind = Kind::kTexts;
  if (leaf.most_repeated > 1 || leaf.type == Physical::kInt96) out.kind = Kind::kNotRead;
  return out;
}

}  // namespace

File::File(const fs::path& path) : path_(path) {
  const std::uint64_t size = size_of_file(path);
  layout_ = with_place(path.string(),
                       [&] { return std::make_unique<const Layout>(layout_of(path, size)); });
  for (const Leaf& leaf : layout_->leaves) columns_.push_back(column_of(leaf));
}

File::~File() = default;

bool File::has(std::string_view name) const {
  return std::ranges::find(columns_, name, &Column::name) != columns_.end();
}

std::size_t File::rows() const {
  std::size_t out = 0;
  for (const RowGroup& group : layout_->groups) out += static_cast<std::size_t>(group.rows);
  return out;
}

template <typename Value>
Values<Value> File::read(std::string_view name, Kind kind) const {
  const auto found = std::ranges::find(columns_, name, &Column::name);
  const std::string place = fmt::format("{}: column '{}'", path_.string(), name);
  if (found == columns_.end()) {
    std::vector<std::string> names;
    for (const Column& column : columns_) names.push_back(column.name);
    throw bad_input(place, "there is none of this name",
                    fmt::format("its columns are {}", fmt::join(names, ", ")));
  }
  if (found->kind != kind) {
    throw bad_input(place,
                    found->kind == Kind::kNotRead ? "is a list of lists or of old stamps"
                    : kind == Kind::kNumbers      ? "holds texts or bytes, not numbers"
                                                  : "holds numbers, not texts",
                    "is this the right file?");
  }
  const auto column = static_cast<std::size_t>(found - columns_.begin());
  return with_place(place, [&] {
    Values<Value> out;
    for (const RowGroup& group : layout_->groups) {
      const Chunk& chunk = group.chunks[column];
      append_chunk(read_part(path_, chunk.begin, chunk.size), layout_->leaves[column], chunk,
                   group.rows, out);
    }
    return out;
  });
}

Numbers File::numbers(std::string_view name) const { return read<double>(name, Kind::kNumbers); }
Texts File::texts(std::string_view name) const { return read<std::string>(name, Kind::kTexts); }

}  // namespace kinescope::parquet
