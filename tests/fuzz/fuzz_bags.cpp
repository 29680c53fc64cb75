// SPDX-License-Identifier: Apache-2.0
//
// Bags: containers, packed chunks, messages.
#include "kinematics/bags/bag_contents.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  const std::string_view bytes = fuzz::text_of(data, size);
  const char* name = bytes.starts_with("#ROSBAG") ? "x.bag" : "x.mcap";
  if (bytes.starts_with("SQLite")) name = "x.db3";
  const auto path = fuzz::file_of(bytes, name);
  fuzz::expect_answer([&] { (void)bags::read_contents(path); });
  return 0;
}
