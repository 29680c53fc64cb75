// SPDX-License-Identifier: Apache-2.0
//
// Logs with torques, plain or gzipped: columns by name, units, faults.
#include "dynamics/data/torque_data.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  const auto path = fuzz::file_of(fuzz::text_of(data, size), "log.csv");
  fuzz::expect_answer([&] { (void)look_at_torque_log({path}, {}); });
  fuzz::expect_answer([&] { (void)read_checked_log({path}, {}); });
  return 0;
}
