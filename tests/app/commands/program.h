// SPDX-License-Identifier: Apache-2.0
//
// The program as a function: what it prints and the code it ends with.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "app/commands/cli.h"
#include "kinematics/core/error.h"

namespace kinescope {

struct Outcome {
  int code = -1;
  std::string out;
  std::string err;
};

inline Outcome run(std::vector<std::string> words) {
  words.insert(words.begin(), "kinescope");
  std::vector<const char*> argv;
  for (const std::string& word : words) argv.push_back(word.c_str());
  argv.push_back(nullptr);
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome outcome;
  outcome.code = run_program(static_cast<int>(words.size()), argv.data());
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

/// The exit code and one line "kinescope: .." on standard error, after warnings at most. Gives that
/// line.
inline std::string expect_refusal(const std::vector<std::string>& words, ExitCode code,
                                  const std::string& part) {
  Outcome outcome = run(words);
  while (outcome.err.starts_with("warning: ")) outcome.err.erase(0, outcome.err.find('\n') + 1);
  EXPECT_EQ(outcome.code, static_cast<int>(code)) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_TRUE(outcome.err.starts_with("kinescope: ")) << outcome.err;
  EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
  EXPECT_TRUE(outcome.err.ends_with(")\n")) << "a remedy: " << outcome.err;
  EXPECT_NE(outcome.err.find(part), std::string::npos) << outcome.err;
  return outcome.err;
}

}  // namespace kinescope
