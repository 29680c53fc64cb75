// SPDX-License-Identifier: Apache-2.0
#include "app/commands/progress_line.h"

#include <sstream>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

/// A clock that the test turns.
struct ProgressTest : testing::Test {
  std::ostringstream out;
  double now_s = 100.0;
  ProgressLine::Clock clock = [this] { return now_s; };

  std::string text() {
    std::string written = out.str();
    out.str("");
    return written;
  }
};

TEST_F(ProgressTest, PlainLinesAtStageEnds) {
  ProgressLine line(out, false, clock);
  line.update("detect", 0, 4);
  line.update("detect", 2, 4);
  EXPECT_EQ(text(), "");
  now_s += 2.5;
  line.update("detect", 4, 4);
  EXPECT_EQ(text(), "detect: 4 of 4, 2.5 s\n");
  line.update("solve", 3, 0);
  now_s += 1.0;
  line.update("write", 0, 0);
  EXPECT_EQ(text(), "solve: 3, 1.0 s\n") << "the next stage ends this one";
  line.finish();
  EXPECT_EQ(text(), "write: 0.0 s\n");
  line.finish();
  EXPECT_EQ(text(), "");
}

TEST_F(ProgressTest, WhatAStageHasComeToBeginsNoOther) {
  ProgressLine line(out, false, clock);
  line.update("search\tcost 3.0", 1, 0);
  line.update("search\tcost 2.0", 2, 0);
  now_s += 1.0;
  line.update("trial", 0, 0);
  EXPECT_EQ(text(), "search: 2, 1.0 s, cost 2.0\n");
  line.finish();
  EXPECT_EQ(text(), "trial: 0.0 s\n");
}

TEST_F(ProgressTest, NoStageEndsTheLastOne) {
  ProgressLine line(out, true, clock);
  line.update("gip model", 0, 0);
  EXPECT_EQ(text(), "\r\033[Kgip model");
  now_s += 3.0;
  line.update("", 0, 0);
  EXPECT_EQ(text(), "\r\033[Kgip model: 3.0 s\n");
  line.finish();
  EXPECT_EQ(text(), "");
}

TEST_F(ProgressTest, OneLineRewrittenOnATerminal) {
  ProgressLine line(out, true, clock);
  line.update("detect", 0, 100);
  EXPECT_EQ(text(), "\r\033[Kdetect   0 %") << "nothing is known about the rest yet";
  now_s += 0.01;
  line.update("detect", 1, 100);
  EXPECT_EQ(text(), "") << "not more often than the eye reads";
  now_s += 9.99;
  line.update("detect", 25, 100);
  EXPECT_EQ(text(), "\r\033[Kdetect  25 %, 0:30 left") << "10 s for a quarter";
  now_s += 30.0;
  line.update("detect", 100, 100);
  EXPECT_EQ(text(), "\r\033[Kdetect: 100 of 100, 40.0 s\n");
}

TEST_F(ProgressTest, AStageBeginsAgainWhenItIsNamedAgain) {
  ProgressLine line(out, false, clock);
  line.update("solve", 1, 1);
  now_s += 1.0;
  line.update("solve", 1, 1);
  EXPECT_EQ(text(), "solve: 1 of 1, 0.0 s\nsolve: 1 of 1, 0.0 s\n");
}

TEST(ClockText, HoursMinutesSeconds) {
  EXPECT_EQ(clock_text(0.0), "0:00");
  EXPECT_EQ(clock_text(0.2), "0:01");
  EXPECT_EQ(clock_text(725.0), "12:05");
  EXPECT_EQ(clock_text(3729.0), "1:02:09");
  EXPECT_EQ(clock_text(-5.0), "0:00");
}

}  // namespace
}  // namespace kinescope
