// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/median.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

TEST(Median, IsTheMiddleOne) {
  EXPECT_EQ(median_of({}), 0.0);
  EXPECT_EQ(median_of({3.0}), 3.0);
  EXPECT_EQ(median_of({5.0, 1.0, 9.0}), 5.0);
  EXPECT_EQ(median_of({4.0, 1.0, 3.0, 2.0}), 3.0);
}

}  // namespace
}  // namespace kinescope
