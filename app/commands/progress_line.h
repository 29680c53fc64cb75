// SPDX-License-Identifier: Apache-2.0
//
// Progress on standard error: on a terminal one line that is written over, with the share done and
// the time that is left; else one line at the end of each stage.
#pragma once

#include <functional>
#include <mutex>
#include <ostream>
#include <string>
#include <string_view>

namespace kinescope {

class ProgressLine {
 public:
  using Clock = std::function<double()>;  ///< s, from anywhere, never back

  ProgressLine(std::ostream& out, bool terminal, Clock clock);
  /// For standard error and the real clock.
  [[nodiscard]] static ProgressLine for_standard_error();
  ~ProgressLine() { finish(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// What kinematics/core/progress.h asks for; total 0: not known; no stage: the last one has
  /// ended. After a tab the words may say what the stage has come to. Any thread.
  void update(std::string_view words, int done, int total);
  /// Ends the stage that is shown; what is printed next begins at the left edge.
  void finish();

 private:
  void end_stage();
  void rewrite();

  std::ostream& out_;
  bool terminal_;
  Clock clock_;
  std::mutex mutex_;
  std::string stage_;  ///< empty: none is shown
  std::string note_;
  int done_ = 0;
  int total_ = 0;
  double begin_s_ = 0.0;
  double shown_s_ = 0.0;
};

/// "0:07", "12:05", "1:02:09".
[[nodiscard]] std::string clock_text(double seconds);

}  // namespace kinescope
