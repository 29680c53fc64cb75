// SPDX-License-Identifier: Apache-2.0
//
// calibration.json as `kinescope correct` reads it.
#include "app/io/effects_file.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  const auto path = fuzz::file_of(fuzz::text_of(data, size), "calibration.json");
  fuzz::expect_answer([&] { (void)read_effects(path); });
  return 0;
}
