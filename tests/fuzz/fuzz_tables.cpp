// SPDX-License-Identifier: Apache-2.0
//
// Tables of numbers: any CSV, joints.csv, a table of channels.
#include "kinematics/core/csv.h"
#include "kinematics/log/channel_table.h"
#include "kinematics/log/joint_log.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  const std::string_view text = fuzz::text_of(data, size);
  fuzz::expect_answer([&] { (void)parse_csv(text, "table.csv"); });
  fuzz::expect_answer([&] { (void)parse_joint_log(text, "joints.csv"); });
  fuzz::expect_answer([&] { (void)parse_channel_table(text, "channels.csv"); });
  return 0;
}
