// SPDX-License-Identifier: Apache-2.0
//
// Judges traces against what was injected, and counts.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/trace/trace.h"
#include "tests/truth/injected_effect.h"

namespace kinescope {

/// Of a trace of a recording with effects in it.
struct TraceJudgement {
  bool named = false;         ///< the first effect found is one of them
  bool placed = false;        ///< at its joint, tag, ..
  bool complete = false;      ///< every injected effect is found at its place
  bool exact = false;         ///< and nothing else
  bool ambiguous = false;     ///< not found, but named among those that cannot be told apart
  std::optional<bool> sized;  ///< all that were found: within 10 % or within the interval
  double ratio = 0.0;         ///< held-out error after, over that of the clean twin
  std::string answer;         ///< "gear_error q2 + tag_slip tag_12", "clean", "unknown", ..
  std::string first;          ///< the name found first, or the verdict
};

[[nodiscard]] TraceJudgement judge_trace(const Trace& trace,
                                         const std::vector<truth::InjectedEffect>& injected,
                                         const Trace& clean_twin);

/// "gear_error q2 + tag_slip tag_12", or the verdict where nothing was accepted.
[[nodiscard]] std::string answer_of(const Trace& trace);

/// Counts over recordings of one kind.
struct TraceScore {
  int count = 0;
  int named = 0;
  int placed = 0;
  int complete = 0;
  int exact = 0;
  int ambiguous = 0;
  int sized = 0;
  int sized_of = 0;
  std::vector<double> ratios;  ///< where the effects were found
  void add(const TraceJudgement& judgement);
  void add(const TraceScore& other);
  /// Percentages but the first and the last two: n; first answer's name right; and its place; every
  /// effect found; and nothing else; not found but one of several that cannot be told apart; of
  /// those found, size right; held-out error over the clean twin's, median and worst.
  [[nodiscard]] std::string line() const;
  [[nodiscard]] static std::string heading();
};

/// How often each name was the first answer.
class Confusion {
 public:
  void add(const std::string& injected, const std::string& answered);
  void print() const;

 private:
  std::map<std::string, std::map<std::string, int>> counts_;
};

}  // namespace kinescope
