// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/channel_table.h"

#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

RC_GTEST_PROP(ChannelTable, GivesBackEveryNumber, ()) {
  const auto columns = *rc::gen::inRange(1, 6);
  const auto rows = *rc::gen::inRange(1, 20);
  Eigen::MatrixXd values(rows, columns);
  std::string text = "c0";
  for (int c = 1; c < columns; ++c) text += fmt::format(",c{}", c);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      values(r, c) = std::ldexp(*rc::gen::arbitrary<double>(), *rc::gen::inRange(-60, 60));
      text += fmt::format("{}{}", c == 0 ? "\n" : ",", values(r, c));
    }
  }
  const ChannelTable table = parse_channel_table(text, "x");
  RC_ASSERT(table.values.rows() == rows && table.values.cols() == columns);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const bool same = table.values(r, c) == values(r, c) ||
                        (std::isnan(table.values(r, c)) && std::isnan(values(r, c)));
      RC_ASSERT(same);
    }
    RC_ASSERT(table.lines[static_cast<std::size_t>(r)] == static_cast<std::size_t>(r) + 2);
  }
}

TEST(ChannelTable, KeepsHolesInfinitiesAndWords) {
  const ChannelTable table =
      parse_channel_table("kind,t,q1\nlift,0,\nlift,0.1,nan\n# note\ndrop,0.1,-inf\n", "run.csv");
  EXPECT_EQ(table.names, (std::vector<std::string>{"t", "q1"}));
  EXPECT_TRUE(std::isnan(table.values(0, 1)) && std::isnan(table.values(1, 1)));
  EXPECT_EQ(table.values(2, 1), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(table.labels.at("kind"), (std::vector<std::string>{"lift", "lift", "drop"}));
  EXPECT_EQ(table.place(2), "run.csv:5");
  EXPECT_EQ(table.column("q1"), 1);
  EXPECT_FALSE(table.column("kind"));
}

TEST(ChannelTable, RefusesAWordAmongNumbersWithItsLine) {
  try {
    static_cast<void>(parse_channel_table("t,q1\n0,1\n1,oops\n2,3\n", "run.csv"));
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(),
                 "run.csv:3: column 'q1' holds 'oops', not a number (correct or remove the line)");
  }
}

}  // namespace
}  // namespace kinescope
