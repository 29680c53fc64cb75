// SPDX-License-Identifier: Apache-2.0
//
// Parquet files: metadata, pages, every column.
#include "kinematics/parquet/parquet_file.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  const auto path = fuzz::file_of(fuzz::text_of(data, size), "x.parquet");
  fuzz::expect_answer([&] {
    const parquet::File file(path);
    for (const parquet::Column& column : file.columns()) {
      fuzz::expect_answer([&] {
        if (column.kind == parquet::Kind::kNumbers) (void)file.numbers(column.name);
        if (column.kind == parquet::Kind::kTexts) (void)file.texts(column.name);
      });
    }
  });
  return 0;
}
