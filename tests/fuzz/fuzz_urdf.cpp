// SPDX-License-Identifier: Apache-2.0
//
// Robots, with and without masses.
#include "kinematics/urdf/dynamic_urdf.h"
#include "kinematics/urdf/urdf.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  const std::string_view text = fuzz::text_of(data, size);
  fuzz::expect_answer([&] { (void)parse_urdf(text, "robot.urdf"); });
  fuzz::expect_answer([&] { (void)parse_dynamic_urdf(text, "robot.urdf"); });
  return 0;
}
