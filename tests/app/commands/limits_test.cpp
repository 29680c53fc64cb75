// SPDX-License-Identifier: Apache-2.0
#include "app/commands/limits.h"

#include <gtest/gtest.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

RunSummary traced(TraceVerdict verdict) {
  RunSummary run;
  run.trace = Trace{};
  run.trace->verdict = verdict;
  run.trace->reason = "5 stretches of independent data are too few";
  return run;
}

TEST(Limits, TracingThatSaysNothingIsNoAnswer) {
  try {
    require_trace(traced(TraceVerdict::kNothingToSay));
    FAIL() << "no refusal";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kUndetermined);
    EXPECT_NE(std::string(error.what()).find("5 stretches"), std::string::npos);
  }
  EXPECT_NO_THROW(require_trace(traced(TraceVerdict::kClean)));
  EXPECT_NO_THROW(require_trace(traced(TraceVerdict::kUnknown)));
  EXPECT_NO_THROW(require_trace(RunSummary{}));
}

}  // namespace
}  // namespace kinescope
