// SPDX-License-Identifier: Apache-2.0
//
// Files against those of other people's writers (data/README.md), and what is wrong with files.
#include "kinematics/parquet/parquet_file.h"

#include <cmath>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/truth/parquet_writer.h"
#include "tests/truth/temporary_path.h"

namespace kinescope::parquet {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const fs::path kData = fs::path(KINESCOPE_SOURCE_DIR) / "tests/kinematics/parquet/data";

json expected_table() {
  std::ifstream stream(kData / "expected.json");
  return json::parse(stream);
}

void expect_value(double value, const json& expected) {
  if (expected.is_null()) {
    EXPECT_TRUE(std::isnan(value));
  } else if (expected.is_boolean()) {
    EXPECT_EQ(value, expected.get<bool>() ? 1.0 : 0.0);
  } else {
    EXPECT_EQ(value, expected.get<double>());
  }
}

void expect_numbers(const File& file, const std::string& name, const json& expected) {
  const Numbers read = file.numbers(name);
  ASSERT_EQ(read.rows(), expected.size()) << name;
  for (std::size_t row = 0; row < read.rows(); ++row) {
    SCOPED_TRACE(name + ", row " + std::to_string(row));
    const json& wanted = expected[row];
    const bool is_list = name == "observation.state" || name == "action" || name == "holes";
    if (!is_list) {
      ASSERT_EQ(read.size_of(row), 1U);
      expect_value(read.values[read.begin_of(row)], wanted);
      continue;
    }
    ASSERT_EQ(read.size_of(row), wanted.size());  // of null 0
    for (std::size_t i = 0; i < read.size_of(row); ++i)
      expect_value(read.values[read.begin_of(row) + i], wanted[i]);
  }
}

class ByWriter : public testing::TestWithParam<const char*> {};

TEST_P(ByWriter, AllColumnsAreWhatWasWritten) {
  const File file(kData / (std::string(GetParam()) + ".parquet"));
  const json expected = expected_table();
  EXPECT_EQ(file.rows(), 60U);
  ASSERT_EQ(file.columns().size(), expected.size());
  for (const Column& column : file.columns()) {
    ASSERT_TRUE(expected.contains(column.name)) << column.name;
    if (column.kind == Kind::kNumbers) {
      expect_numbers(file, column.name, expected[column.name]);
    } else {
      EXPECT_EQ(file.texts(column.name).values,
                expected[column.name].get<std::vector<std::string>>());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Parquet, ByWriter,
                         testing::Values("duckdb_snappy", "duckdb_gzip", "duckdb_v2_zstd",
                                         "duckdb_v2_plain", "arrow_rs_snappy", "arrow_rs_v2_zstd",
                                         "arrow_rs_v2_delta", "hyparquet_snappy",
                                         "hyparquet_encodings"),
                         [](const auto& writer) { return std::string(writer.param); });

TEST(ParquetFile, OfTheTestsOwnWriterIsReadBack) {
  const fs::path path = truth::temporary_path("own.parquet");
  truth::write_parquet(path, {{"n", std::vector<std::int64_t>{-1, 1LL << 52U, 7}},
                              {"text", std::vector<std::string>{"a", "", "bc"}},
                              {"list", std::vector<std::vector<float>>{{1.5F}, {}, {2.F, 3.F}}}});
  const File file(path);
  EXPECT_EQ(file.numbers("n").values, (std::vector<double>{-1.0, 4503599627370496.0, 7.0}));
  EXPECT_EQ(file.texts("text").values, (std::vector<std::string>{"a", "", "bc"}));
  const Numbers list = file.numbers("list");
  EXPECT_EQ(list.values, (std::vector<double>{1.5, 2.0, 3.0}));
  EXPECT_EQ(list.ends, (std::vector<std::size_t>{1, 1, 3}));
  fs::remove(path);
}

/// What reading all of a file that holds these bytes ends with.
std::string answer_to(const std::string& bytes) {
  const fs::path path = truth::temporary_path("bad.parquet");
  std::ofstream(path, std::ios::binary) << bytes;
  std::string answer = "accepted";
  try {
    const File file(path);
    for (const Column& column : file.columns()) {
      if (column.kind == Kind::kNumbers) static_cast<void>(file.numbers(column.name));
      if (column.kind == Kind::kTexts) static_cast<void>(file.texts(column.name));
    }
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    answer = error.what();
    EXPECT_EQ(answer.find('\n'), std::string::npos);
    EXPECT_NE(answer.find("bad.parquet"), std::string::npos);
  }
  fs::remove(path);
  return answer;
}

void expect_part(const std::string& answer, const std::string& part) {
  EXPECT_NE(answer.find(part), std::string::npos) << answer;
}

TEST(ParquetFile, CutAnywhereIsRefused) {
  const std::string whole = read_text_file(kData / "hyparquet_encodings.parquet");
  for (std::size_t size = 0; size < whole.size(); size += 7)
    EXPECT_NE(answer_to(whole.substr(0, size)), "accepted") << size;
  expect_part(answer_to(whole.substr(0, whole.size() / 2)), "cut off, or its writer was killed");
  expect_part(answer_to(""), "it is empty");
  expect_part(answer_to("t,joint1\n0.0,1.0\n0.1,1.1\n"), "does not begin as a Parquet file does");
}

TEST(ParquetFile, WithAnyByteChangedIsReadOrRefused) {
  for (const char* name : {"duckdb_snappy.parquet", "hyparquet_encodings.parquet"}) {
    const std::string whole = read_text_file(kData / name);
    for (std::size_t at = 0; at < whole.size(); ++at) {
      std::string changed = whole;
      changed[at] = static_cast<char>(changed[at] ^ (1 << at % 8));
      static_cast<void>(answer_to(changed));  // another exception ends the test
    }
  }
}

TEST(ParquetFile, WhatIsNotReadIsNamed) {
  expect_part(answer_to(read_text_file(kData / "duckdb_brotli.parquet")),
              "compression brotli is not read");
  expect_part(answer_to(read_text_file(kData / "arrow_rs_delta_bytes.parquet")),
              "column 'task': encoding 7 is not read");
  const File file(kData / "duckdb_snappy.parquet");
  try {
    static_cast<void>(file.numbers("speed"));
    FAIL();
  } catch (const Error& error) {
    expect_part(error.what(), "column 'speed': there is none of this name (its columns are obs");
  }
  try {
    static_cast<void>(file.numbers("task"));
    FAIL();
  } catch (const Error& error) {
    expect_part(error.what(), "holds texts or bytes, not numbers");
  }
  EXPECT_THROW(File(kData / "none.parquet"), Error);
  EXPECT_THROW(File{kData}, Error);
}

/// The metadata of one column of doubles, behind a page.
std::string file_with(std::int64_t rows, const truth::ThriftWriter& facts,
                      const std::string& page) {
  using truth::ThriftWriter;
  const std::vector<ThriftWriter> schema{ThriftWriter().text(4, "schema").i32(5, 1),
                                         ThriftWriter().i32(1, 5).i32(3, 0).text(4, "x")};
  const ThriftWriter chunk = ThriftWriter().i64(2, 4).inside(3, facts);
  const ThriftWriter group = ThriftWriter().structs(1, {chunk}).i64(2, 0).i64(3, rows);
  const std::string footer =
      ThriftWriter().i32(1, 1).structs(2, schema).i64(3, rows).structs(4, {group}).bytes();
  std::string out = "PAR1" + page + footer;
  for (unsigned shift = 0; shift < 32; shift += 8)
    out += static_cast<char>(footer.size() >> shift & 0xFFU);
  return out + "PAR1";
}

truth::ThriftWriter facts_of(std::int64_t codec, std::int64_t values, std::size_t size) {
  const auto bytes = static_cast<std::int64_t>(size);
  return truth::ThriftWriter()
      .i32(1, 5)
      .i32(4, codec)
      .i64(5, values)
      .i64(6, bytes)
      .i64(7, bytes)
      .i64(9, 4);
}

std::string data_page(std::int64_t values, std::int64_t unpacked, std::int64_t packed,
                      std::int64_t encoding, const std::string& bytes) {
  using truth::ThriftWriter;
  const ThriftWriter data = ThriftWriter().i32(1, values).i32(2, encoding).i32(3, 3).i32(4, 3);
  return ThriftWriter().i32(1, 0).i32(2, unpacked).i32(3, packed).inside(5, data).bytes() + bytes;
}

TEST(ParquetFile, SizesAndCountsThatLieAreRefused) {
  const std::string one(8, '\0');
  const std::string page = data_page(1, 8, 8, 0, one);
  EXPECT_EQ(answer_to(file_with(1, facts_of(0, 1, page.size()), page)), "accepted");
  expect_part(answer_to(file_with(-1, facts_of(0, 1, page.size()), page)), "declares -1 rows");
  expect_part(answer_to(file_with(2, facts_of(0, 1, page.size()), page)),
              "declares 1 values in 2 rows");
  expect_part(answer_to(file_with(1LL << 62, facts_of(0, 1, page.size()), page)),
              "it has more than 100000000 rows");
  expect_part(answer_to(file_with(1, facts_of(0, 1, 1U << 30U), page)),
              "column 'x' goes on beyond the file's end");
  const std::string long_page = data_page(1, 8, 800, 0, one);
  expect_part(answer_to(file_with(1, facts_of(0, 1, long_page.size()), long_page)),
              "a page goes on beyond its column");
  const std::string empty_page = data_page(5, 8, 8, 0, one);
  expect_part(answer_to(file_with(5, facts_of(0, 5, empty_page.size()), empty_page)),
              "a page ends before its last value");
  const std::string no_dictionary = data_page(1, 8, 8, 8, one);
  expect_part(answer_to(file_with(1, facts_of(0, 1, no_dictionary.size()), no_dictionary)),
              "its dictionary is missing");
  // A page of little that says it unpacks to much.
  const std::string bomb = data_page(1, 1 << 28, 8, 0, one);
  expect_part(answer_to(file_with(1, facts_of(1, 1, bomb.size()), bomb)),
              "does not unpack to what");
  const std::string giant = data_page(1, 1LL << 30, 8, 0, one);
  expect_part(answer_to(file_with(1, facts_of(6, 1, giant.size()), giant)),
              "pages of more than 256 MiB");
}

TEST(ParquetFile, MetadataNestedWithoutEndIsRefused) {
  std::string deep(100'000, '\x1C');  // a struct in a struct in a struct ..
  const std::size_t size = deep.size();
  std::string file = "PAR1" + deep;
  for (unsigned shift = 0; shift < 32; shift += 8) file += static_cast<char>(size >> shift & 0xFFU);
  expect_part(answer_to(file + "PAR1"), "its metadata is no metadata of Parquet");
}

}  // namespace
}  // namespace kinescope::parquet
