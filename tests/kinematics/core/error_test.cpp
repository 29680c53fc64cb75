// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/error.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

TEST(Error, IsOneLineThatNamesPlaceAndRemedy) {
  const Error error = bad_input("robot.urdf:3", "no link 'a'", "name one that is there");
  EXPECT_STREQ(error.what(), "robot.urdf:3: no link 'a' (name one that is there)");
  EXPECT_EQ(error.code(), ExitCode::kBadInput);
}

TEST(Error, NamesFromAFileNeitherBreakTheLineNorReachTheTerminal) {
  const Error error = bad_input("a\nb.csv", "no link '\x1b[31m\r\tred\x7f'", "check\n");
  EXPECT_STREQ(error.what(), "a b.csv: no link ' [31m  red ' (check )");
  EXPECT_STREQ(bad_request("", "grün", "").what(), "grün");
}

}  // namespace
}  // namespace kinescope
