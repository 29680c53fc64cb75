// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/parquet_writer.h"

#include <cstring>
#include <fstream>
#include <type_traits>

namespace kinescope::truth {
namespace {

template <typename Number>
void put(std::string& bytes, Number value) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  bytes.append(raw, sizeof value);
}

/// Runs of one level, as RLE has them for levels of up to 8 bits, behind their length.
std::string levels(const std::vector<int>& values) {
  std::string runs;
  for (std::size_t begin = 0; begin < values.size();) {
    std::size_t end = begin;
    while (end < values.size() && values[end] == values[begin] && end - begin < 63) ++end;
    runs += static_cast<char>((end - begin) << 1U);
    runs += static_cast<char>(values[begin]);
    begin = end;
  }
  std::string out;
  put(out, static_cast<std::uint32_t>(runs.size()));
  return out + runs;
}

/// A page's values, and what its column is.
struct PageOfTest {
  std::string bytes;
  std::size_t values = 0;
  int type = 0;
  bool is_list = false;
};

template <typename Number>
PageOfTest page_of(const std::vector<Number>& values) {
  PageOfTest out;
  out.values = values.size();
  if constexpr (std::is_same_v<Number, std::int64_t>) out.type = 2;
  if constexpr (std::is_same_v<Number, float>) out.type = 4;
  if constexpr (std::is_same_v<Number, double>) out.type = 5;
  for (const Number value : values) put(out.bytes, value);
  return out;
}

PageOfTest page_of(const std::vector<std::string>& values) {
  PageOfTest out;
  out.values = values.size();
  out.type = 6;
  for (const std::string& value : values) {
    put(out.bytes, static_cast<std::uint32_t>(value.size()));
    out.bytes += value;
  }
  return out;
}

PageOfTest page_of(const std::vector<std::vector<float>>& rows) {
  PageOfTest out;
  out.type = 4;
  out.is_list = true;
  std::vector<int> repeated;
  std::vector<int> defined;
  for (const std::vector<float>& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) repeated.push_back(i == 0 ? 0 : 1);
    if (row.empty()) repeated.push_back(0);
    defined.insert(defined.end(), std::max<std::size_t>(1, row.size()), row.empty() ? 1 : 3);
  }
  out.values = repeated.size();
  out.bytes = levels(repeated) + levels(defined);
  for (const std::vector<float>& row : rows)
    for (const float value : row) put(out.bytes, value);
  return out;
}

void add_schema(const ParquetColumn& column, const PageOfTest& page,
                std::vector<ThriftWriter>& schema) {
  constexpr int kRequired = 0;
  constexpr int kOptional = 1;
  constexpr int kRepeated = 2;
  if (!page.is_list) {
    schema.push_back(ThriftWriter().i32(1, page.type).i32(3, kRequired).text(4, column.name));
    return;
  }
  schema.push_back(ThriftWriter().i32(3, kOptional).text(4, column.name).i32(5, 1).i32(6, 3));
  schema.push_back(ThriftWriter().i32(3, kRepeated).text(4, "list").i32(5, 1));
  schema.push_back(ThriftWriter().i32(1, page.type).i32(3, kOptional).text(4, "element"));
}

/// Appends the page, gives the description of its column.
ThriftWriter add_page(const ParquetColumn& column, const PageOfTest& page, std::string& file) {
  const auto size = static_cast<std::int64_t>(page.bytes.size());
  const auto values = static_cast<std::int64_t>(page.values);
  const ThriftWriter data = ThriftWriter().i32(1, values).i32(2, 0).i32(3, 3).i32(4, 3);
  const std::string head =
      ThriftWriter().i32(1, 0).i32(2, size).i32(3, size).inside(5, data).bytes();
  const auto begin = static_cast<std::int64_t>(file.size());
  file += head + page.bytes;
  const std::int64_t whole = size + static_cast<std::int64_t>(head.size());
  std::vector<std::string> path{column.name};
  if (page.is_list) path.insert(path.end(), {"list", "element"});
  const ThriftWriter facts = ThriftWriter()
                                 .i32(1, page.type)
                                 .i32s(2, {0, 3})
                                 .texts(3, path)
                                 .i32(4, 0)
                                 .i64(5, values)
                                 .i64(6, whole)
                                 .i64(7, whole)
                                 .i64(9, begin);
  return ThriftWriter().i64(2, begin).inside(3, facts);
}

}  // namespace

ThriftWriter& ThriftWriter::varint(std::uint64_t value) {
  for (; value >= 0x80U; value >>= 7U) bytes_ += static_cast<char>(value | 0x80U);
  bytes_ += static_cast<char>(value);
  return *this;
}

ThriftWriter& ThriftWriter::zigzag(std::int64_t value) {
  return varint(static_cast<std::uint64_t>(value) << 1U ^ static_cast<std::uint64_t>(value >> 63));
}

ThriftWriter& ThriftWriter::head(int field, unsigned type) {
  bytes_ += static_cast<char>(static_cast<unsigned>(field - last_) << 4U | type);
  last_ = field;
  return *this;
}

ThriftWriter& ThriftWriter::list(int field, unsigned type, std::size_t size) {
  head(field, 9);
  bytes_ += static_cast<char>(15U << 4U | type);
  return varint(size);
}

ThriftWriter& ThriftWriter::text(int field, const std::string& text) {
  head(field, 8).varint(text.size());
  bytes_ += text;
  return *this;
}

ThriftWriter& ThriftWriter::inside(int field, const ThriftWriter& other) {
  head(field, 12).bytes_ += other.bytes();
  return *this;
}

ThriftWriter& ThriftWriter::structs(int field, const std::vector<ThriftWriter>& elements) {
  list(field, 12, elements.size());
  for (const ThriftWriter& element : elements) bytes_ += element.bytes();
  return *this;
}

ThriftWriter& ThriftWriter::texts(int field, const std::vector<std::string>& elements) {
  list(field, 8, elements.size());
  for (const std::string& element : elements) {
    varint(element.size());
    bytes_ += element;
  }
  return *this;
}

ThriftWriter& ThriftWriter::i32s(int field, const std::vector<std::int64_t>& elements) {
  list(field, 5, elements.size());
  for (const std::int64_t element : elements) zigzag(element);
  return *this;
}

std::string parquet_bytes(const std::vector<ParquetColumn>& columns) {
  std::string file = "PAR1";
  std::vector<ThriftWriter> schema{
      ThriftWriter().text(4, "schema").i32(5, static_cast<std::int64_t>(columns.size()))};
  std::vector<ThriftWriter> chunks;
  std::size_t rows = 0;
  for (const ParquetColumn& column : columns) {
    const PageOfTest page =
        std::visit([](const auto& values) { return page_of(values); }, column.values);
    rows = std::visit([](const auto& values) { return values.size(); }, column.values);
    add_schema(column, page, schema);
    chunks.push_back(add_page(column, page, file));
  }
  const auto count = static_cast<std::int64_t>(rows);
  const ThriftWriter group = ThriftWriter()
                                 .structs(1, chunks)
                                 .i64(2, static_cast<std::int64_t>(file.size()))
                                 .i64(3, count);
  const std::string footer =
      ThriftWriter().i32(1, 1).structs(2, schema).i64(3, count).structs(4, {group}).bytes();
  file += footer;
  put(file, static_cast<std::uint32_t>(footer.size()));
  return file + "PAR1";
}

void write_parquet(const std::filesystem::path& path, const std::vector<ParquetColumn>& columns) {
  std::filesystem::create_directories(path.parent_path());
  const std::string bytes = parquet_bytes(columns);
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace kinescope::truth
