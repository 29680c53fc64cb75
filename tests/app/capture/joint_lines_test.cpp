// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "app/capture/joint_feed.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

TEST(JointLines, RowsAreStampedWhenTheyComeWhole) {
  JointLines lines;
  EXPECT_TRUE(lines.add("arm,li", 10.0).empty());
  EXPECT_TRUE(lines.add("ft\n0.1", 10.1).empty());
  EXPECT_EQ(lines.channels(), (std::vector<std::string>{"arm", "lift"}));
  const std::vector<JointRow> rows = lines.add(",0.2\r\n", 10.2);
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_DOUBLE_EQ(rows[0].stamp_s, 10.2);
  EXPECT_EQ(rows[0].values, (std::vector{0.1, 0.2}));
  EXPECT_EQ(lines.stamps(), "reception");
}

TEST(JointLines, TheSendersClockIsShiftedAsAWhole) {
  JointLines lines;
  std::vector<double> stamps_s;
  const auto add = [&](const std::string& text, double now_s) {
    for (const JointRow& row : lines.add(text, now_s)) stamps_s.push_back(row.stamp_s);
  };
  add("arm,t_ms,lift\n1,5000,2\n", 10.0);
  add("1,5010,2\n1,5020,2\n", 10.2);  // held up
  EXPECT_EQ(lines.channels(), (std::vector<std::string>{"arm", "lift"}));
  ASSERT_EQ(stamps_s.size(), 3U);
  for (std::size_t i = 0; i < stamps_s.size(); ++i)
    EXPECT_NEAR(stamps_s[i], 10.0 + 0.01 * static_cast<double>(i), 1e-9);
  EXPECT_EQ(lines.stamps(), "sender");
}

TEST(JointLines, AColumnThatIsNoClockIsSaid) {
  for (const std::string second : {"6000", "5", "4"}) {  // ms as s, one that stands, goes back
    JointLines lines;
    static_cast<void>(lines.add("t,arm\n5,1\n", 10.0));
    std::vector<JointRow> rows = lines.add(second + ",2\n", 10.1);
    const std::vector<std::string> warnings = lines.take_warnings();
    ASSERT_EQ(warnings.size(), 1U);
    EXPECT_NE(warnings[0].find("line 3: the time column does not go with the clock"),
              std::string::npos);
    ASSERT_EQ(rows.size(), 1U);
    EXPECT_DOUBLE_EQ(rows[0].stamp_s, 10.1);
    EXPECT_EQ(rows[0].values, std::vector{2.0}) << "without the time";
    EXPECT_EQ(lines.stamps(), "reception");
  }
}

TEST(JointLines, StampsGoForwardWhereTheClockChanges) {
  JointLines lines;
  static_cast<void>(lines.add("t,arm\n5,1\n5.5,1\n", 10.0));  // until 10.5
  EXPECT_TRUE(lines.add("5.1,2\n", 10.3).empty());
  EXPECT_EQ(lines.add("5.2,2\n", 10.6).size(), 1U);
}

TEST(JointLines, RowsOfOnePieceAreSpread) {
  JointLines lines;
  static_cast<void>(lines.add("arm\n1\n", 10.0));
  const std::vector<JointRow> rows = lines.add("2\n3\n", 11.0);
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_DOUBLE_EQ(rows[0].stamp_s, 10.5);
  EXPECT_DOUBLE_EQ(rows[1].stamp_s, 11.0);
}

TEST(JointLines, ALineThatIsNoneIsNamedAndTheNextOneRead) {
  JointLines lines;
  const std::vector<JointRow> rows = lines.add("arm,lift\n1,2\n3,x\n4\n5,nan\n6,7\n", 1.0);
  EXPECT_EQ(rows.size(), 2U);
  const std::vector<std::string> warnings = lines.take_warnings();
  ASSERT_EQ(warnings.size(), 3U);
  EXPECT_EQ(warnings[0], "--joints, line 3: 'x' is no number: the line is left out");
  EXPECT_EQ(warnings[1], "--joints, line 4: has 1 values, not 2: the line is left out");
  EXPECT_NE(warnings[2].find("line 5: 'nan' is no number"), std::string::npos);
  EXPECT_TRUE(lines.take_warnings().empty()) << "each once";
}

TEST(JointLines, ManyBadLinesAreNoFlood) {
  JointLines lines;
  static_cast<void>(lines.add("arm\n", 1.0));
  for (int i = 0; i < 100; ++i) static_cast<void>(lines.add("x\n", 1.0));
  const std::vector<std::string> warnings = lines.take_warnings();
  ASSERT_EQ(warnings.size(), 5U);
  EXPECT_NE(warnings.back().find("as are further ones"), std::string::npos);
}

TEST(JointLines, WhatWasThereBeforeIsNoRow) {
  JointLines lines;
  lines.pass_over("arm\n1\n2\n3");
  const std::vector<JointRow> rows = lines.add("4\n5\n", 1.0);
  ASSERT_EQ(rows.size(), 2U) << "the line that was being written, and the new one";
  EXPECT_EQ(rows[1].values, std::vector{5.0});
}

TEST(JointLines, NumbersAreNoHeader) {
  JointLines lines;
  EXPECT_THROW(static_cast<void>(lines.add("0.1,0.2\n", 1.0)), Error);
}

}  // namespace
}  // namespace kinescope
