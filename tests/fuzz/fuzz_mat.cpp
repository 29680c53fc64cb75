// SPDX-License-Identifier: Apache-2.0
//
// MAT-files: elements, variables, the table that they make.
#include "kinematics/mat/mat_log.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  fuzz::expect_answer([&] {
    (void)mat::table_of(mat::parse_variables(fuzz::text_of(data, size), "x.mat"), "x.mat");
  });
  return 0;
}
