// SPDX-License-Identifier: Apache-2.0
#include "kinematics/parquet/file_layout.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/csv.h"
#include "kinematics/parquet/damage.h"
#include "kinematics/parquet/thrift_reader.h"

namespace kinescope::parquet {
namespace {

using Field = ThriftReader::Field;
using Type = ThriftReader::Type;

/// The most that is read of one file, as of tables (csv.h).
constexpr std::uint64_t kMostRows = kMostCells;
constexpr int kDeepestSchema = 16;
constexpr std::size_t kLongestName = 512;

enum class Repetition { kRequired = 0, kOptional = 1, kRepeated = 2 };

struct SchemaElement {
  std::optional<Physical> type;
  std::size_t fixed_size = 0;
  Repetition repetition = Repetition::kRequired;
  std::string name;
  std::size_t children = 0;
};

/// A number that may not be negative.
std::uint64_t count_of(std::int64_t number, const char* what) {
  if (number < 0) throw Damage{fmt::format("its metadata declares {} {}", number, what)};
  return static_cast<std::uint64_t>(number);
}

template <typename Enum>
Enum enum_of(std::int64_t number, Enum last, const char* what) {
  if (number < 0 || number > static_cast<std::int64_t>(last))
    throw Damage{fmt::format("its metadata names {} {}, which there is not", what, number)};
  return static_cast<Enum>(number);
}

SchemaElement read_element(ThriftReader& reader) {
  SchemaElement out;
  reader.each_field([&](const Field& field) {
    switch (field.id) {
      case 1:
        out.type = enum_of(reader.integer(field), Physical::kFixedBytes, "type");
        return true;
      case 2:
        out.fixed_size = count_of(reader.integer(field), "bytes of a value");
        return true;
      case 3:
        out.repetition = enum_of(reader.integer(field), Repetition::kRepeated, "repetition");
        return true;
      case 4:
        out.name = reader.binary(field);
        if (out.name.size() > kLongestName) throw Damage{"it names a column without end"};
        return true;
      case 5:
        out.children = count_of(reader.integer(field), "columns in a column");
        return true;
      default:
        return false;
    }
  });
  return out;
}

/// Walks the schema's tree, which is listed in depth-first order.
class SchemaWalk {
 public:
  explicit SchemaWalk(const std::vector<SchemaElement>& elements) : elements_(elements) {}

  std::vector<Leaf> leaves() {
    if (elements_.empty()) throw Damage{"it has no schema"};
    const std::size_t columns = elements_.front().children;
    for (std::size_t column = 0; column < columns; ++column) add_column();
    if (next_ != elements_.size()) throw wrong_tree();
    return std::move(leaves_);
  }

 private:
  static Damage wrong_tree() { return {"its schema is no tree"}; }

  void add_column() {
    const std::size_t before = leaves_.size();
    if (next_ >= elements_.size()) throw wrong_tree();
    const std::string name = elements_[next_].name;
    add(name, Leaf{}, 0);
    // A list's only leaf is called as its column is; "list.element" says nothing.
    if (leaves_.size() == before + 1) leaves_.back().name = name;
  }

  void add(const std::string& path, Leaf around, int depth) {
    if (next_ >= elements_.size() || depth == kDeepestSchema) throw wrong_tree();
    const SchemaElement& element = elements_[next_++];
    if (element.repetition != Repetition::kRequired) ++around.most_defined;
    if (element.repetition == Repetition::kRepeated) {
      ++around.most_repeated;
      around.in_list = around.most_defined;
    }
    if (element.children == 0) {
      if (!element.type) throw wrong_tree();
      around.name = path;
      around.type = *element.type;
      around.fixed_size = element.fixed_size;
      leaves_.push_back(std::move(around));
      return;
    }
    for (std::size_t child = 0; child < element.children; ++child) {
      if (next_ >= elements_.size()) throw wrong_tree();
      add(path + "." + elements_[next_].name, around, depth + 1);
    }
  }

  const std::vector<SchemaElement>& elements_;
  std::size_t next_ = 1;  // behind the root
  std::vector<Leaf> leaves_;
};

/// Of ColumnMetaData.
struct ChunkFields {
  std::optional<std::int64_t> codec, values, unpacked, packed, data_at, dictionary_at;
  std::optional<std::int64_t> type;
};

ChunkFields read_chunk_fields(ThriftReader& reader) {
  ChunkFields out;
  reader.each_field([&](const Field& field) {
    const auto take = [&](std::optional<std::int64_t>& value) {
      value = reader.integer(field);
      return true;
    };
    switch (field.id) {
      case 1:
        return take(out.type);
      case 4:
        return take(out.codec);
      case 5:
        return take(out.values);
      case 6:
        return take(out.unpacked);
      case 7:
        return take(out.packed);
      case 9:
        return take(out.data_at);
      case 11:
        return take(out.dictionary_at);
      default:
        return false;
    }
  });
  return out;
}

Codec codec_of(std::int64_t number) {
  constexpr std::array kNames = {"none", "snappy", "gzip", "lzo", "brotli", "lz4", "zstd", "lz4"};
  const auto codec = static_cast<Codec>(number);
  if (codec == Codec::kNone || codec == Codec::kSnappy || codec == Codec::kGzip ||
      codec == Codec::kZstd) {
    return codec;
  }
  const bool known = number >= 0 && number < static_cast<std::int64_t>(kNames.size());
  throw NotRead{fmt::format(
      "compression {}", known ? kNames[static_cast<std::size_t>(number)] : std::to_string(number))};
}

Chunk chunk_of(const ChunkFields& fields, const Leaf& leaf, std::uint64_t file_size) {
  const auto missing = Damage{fmt::format("its metadata of column '{}' is incomplete", leaf.name)};
  if (!fields.codec || !fields.values || !fields.packed || !fields.data_at || !fields.type ||
      !fields.unpacked) {
    throw missing;
  }
  if (*fields.type != static_cast<std::int64_t>(leaf.type))
    throw Damage{fmt::format("column '{}' has two types", leaf.name)};
  Chunk out;
  out.codec = codec_of(*fields.codec);
  out.values = count_of(*fields.values, "values");
  out.unpacked = count_of(*fields.unpacked, "bytes");
  out.size = count_of(*fields.packed, "bytes");
  out.begin = count_of(*fields.data_at, "as a place");
  // Some writers say 0 where there is no dictionary.
  if (fields.dictionary_at && *fields.dictionary_at > 0)
    out.begin = std::min(out.begin, count_of(*fields.dictionary_at, "as a place"));
  if (out.begin > file_size || out.size > file_size - out.begin)
    throw Damage{fmt::format("column '{}' goes on beyond the file's end", leaf.name)};
  return out;
}

Chunk read_chunk(ThriftReader& reader, const Leaf& leaf, std::uint64_t file_size) {
  std::optional<ChunkFields> fields;
  reader.each_field([&](const Field& field) {
    if (field.id == 1) throw NotRead{"columns in other files"};
    if (field.id == 8) throw NotRead{"encryption"};
    if (field.id != 3 || field.type != Type::kStruct) return false;
    fields = read_chunk_fields(reader);
    return true;
  });
  if (!fields) throw Damage{fmt::format("column '{}' has no metadata", leaf.name)};
  return chunk_of(*fields, leaf, file_size);
}

RowGroup read_group(ThriftReader& reader, const std::vector<Leaf>& leaves,
                    std::uint64_t file_size) {
  RowGroup out;
  reader.each_field([&](const Field& field) {
    if (field.id == 3) {
      out.rows = count_of(reader.integer(field), "rows");
      return true;
    }
    if (field.id != 1) return false;
    reader.each_element(field, Type::kStruct, [&](std::size_t size) {
      if (size != leaves.size())
        throw Damage{fmt::format("a row group has {} columns, the schema {}", size, leaves.size())};
      if (out.chunks.size() == size) throw Damage{"a row group has its columns twice"};
      out.chunks.push_back(read_chunk(reader, leaves[out.chunks.size()], file_size));
    });
    return true;
  });
  if (out.chunks.size() != leaves.size()) throw Damage{"a row group has no columns"};
  return out;
}

void read_schema(ThriftReader& reader, const Field& field, Layout& out) {
  std::vector<SchemaElement> elements;
  reader.each_element(field, Type::kStruct, [&](std::size_t size) {
    if (size > kMostColumns)
      throw Damage{fmt::format("it has {} columns, more than {}", size, kMostColumns)};
    elements.push_back(read_element(reader));
  });
  out.leaves = SchemaWalk(elements).leaves();
}

void check_rows(const Layout& layout, std::uint64_t declared) {
  std::uint64_t rows = 0;
  for (const RowGroup& group : layout.groups) {
    if (group.rows > kMostRows - rows)
      throw Damage{fmt::format("it has more than {} rows", kMostRows)};
    rows += group.rows;
  }
  if (rows != declared) throw Damage{fmt::format("it declares {} rows and has {}", declared, rows)};
}

/// A value of a page's header: sizes and counts are 32 bits.
std::size_t size_of(ThriftReader& reader, const Field& field) {
  return static_cast<std::size_t>(count_of(reader.integer(field), "bytes or values of a page"));
}

void read_data_header(ThriftReader& reader, PageHeader& out) {
  reader.each_field([&](const Field& field) {
    if (field.id == 1) out.values = size_of(reader, field);
    if (field.id == 2)
      out.encoding = enum_of(reader.integer(field), Encoding::kByteStreamSplit, "encoding");
    // Levels may be RLE only: bit-packed ones are of writers before 2014.
    if ((field.id == 3 || field.id == 4) && reader.integer(field) != 3)
      throw NotRead{"levels that are bit-packed"};
    return field.id >= 1 && field.id <= 4;
  });
}

void read_dictionary_header(ThriftReader& reader, PageHeader& out) {
  reader.each_field([&](const Field& field) {
    if (field.id == 1) out.values = size_of(reader, field);
    if (field.id == 2)
      out.encoding = enum_of(reader.integer(field), Encoding::kByteStreamSplit, "encoding");
    return field.id == 1 || field.id == 2;
  });
}

void read_data_v2_header(ThriftReader& reader, PageHeader& out) {
  reader.each_field([&](const Field& field) {
    switch (field.id) {
      case 1:
        out.values = size_of(reader, field);
        return true;
      case 4:
        out.encoding = enum_of(reader.integer(field), Encoding::kByteStreamSplit, "encoding");
        return true;
      case 5:
        out.defined_size = size_of(reader, field);
        return true;
      case 6:
        out.repeated_size = size_of(reader, field);
        return true;
      case 7:
        out.is_packed = reader.boolean(field);
        return true;
      default:
        return false;
    }
  });
}

}  // namespace

Layout read_layout(std::string_view footer, std::uint64_t file_size) {
  ThriftReader reader(footer);
  Layout out;
  std::uint64_t rows = 0;
  bool has_schema = false;
  reader.each_field([&](const Field& field) {
    if (field.id == 2) {
      if (std::exchange(has_schema, true)) throw Damage{"it has two schemas"};
      read_schema(reader, field, out);
      return true;
    }
    if (field.id == 3) {
      rows = count_of(reader.integer(field), "rows");
      return true;
    }
    if (field.id == 8) throw NotRead{"encryption"};
    if (field.id != 4) return false;
    if (!has_schema) throw Damage{"its schema does not come first"};
    reader.each_element(field, Type::kStruct, [&](std::size_t) {
      out.groups.push_back(read_group(reader, out.leaves, file_size));
    });
    return true;
  });
  check_rows(out, rows);
  return out;
}

PageHeader read_page_header(std::string_view bytes) {
  ThriftReader reader(bytes);
  PageHeader out;
  std::optional<PageType> type;
  std::optional<PageType> described;
  const auto describe = [&](PageType as, auto read) {
    described = as;
    read(reader, out);
    return true;
  };
  reader.each_field([&](const Field& field) {
    switch (field.id) {
      case 1:
        type = enum_of(reader.integer(field), PageType::kDataV2, "page type");
        return true;
      case 2:
        out.unpacked_size = size_of(reader, field);
        return true;
      case 3:
        out.packed_size = size_of(reader, field);
        return true;
      case 5:
        return describe(PageType::kData, read_data_header);
      case 7:
        return describe(PageType::kDictionary, read_dictionary_header);
      case 8:
        return describe(PageType::kDataV2, read_data_v2_header);
      default:
        return false;
    }
  });
  if (!type || (*type != PageType::kIndex && described != type))
    throw Damage{"a page is not described"};
  out.type = *type;
  out.header_size = reader.position();
  return out;
}

}  // namespace kinescope::parquet
