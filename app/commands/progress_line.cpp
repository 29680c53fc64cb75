// SPDX-License-Identifier: Apache-2.0
#include "app/commands/progress_line.h"

#include <chrono>
#include <cmath>
#include <iostream>

#include <fmt/format.h>
#include <unistd.h>

namespace kinescope {
namespace {

constexpr double kSecondsBetweenRewrites = 0.1;
constexpr const char* kEraseLine = "\r\033[K";

}  // namespace

std::string clock_text(double seconds) {
  const auto whole = static_cast<long>(std::ceil(std::max(0.0, seconds)));
  if (whole >= 3600) {
    return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
  }
  return fmt::format("{}:{:02}", whole / 60, whole % 60);
}

ProgressLine::ProgressLine(std::ostream& out, bool terminal, Clock clock)
    : out_(out), terminal_(terminal), clock_(std::move(clock)) {}

ProgressLine ProgressLine::for_standard_error() {
  return {
      std::cerr, ::isatty(STDERR_FILENO) == 1, [] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
            .count();
      }};
}

void ProgressLine::update(std::string_view words, int done, int total) {
  const std::lock_guard lock(mutex_);
  const std::string_view stage = words.substr(0, words.find('\t'));
  if (stage != stage_) {
    end_stage();
    stage_ = stage;
    begin_s_ = clock_();
    shown_s_ = begin_s_ - 2.0 * kSecondsBetweenRewrites;
  }
  note_ = stage.size() < words.size() ? fmt::format(", {}", words.substr(stage.size() + 1)) : "";
  done_ = done;
  total_ = total;
  if (stage_.empty()) return;
  if (total_ > 0 && done_ >= total_) {
    end_stage();
  } else if (terminal_ && clock_() - shown_s_ >= kSecondsBetweenRewrites) {
    rewrite();
  }
}

void ProgressLine::finish() {
  const std::lock_guard lock(mutex_);
  end_stage();
}

void ProgressLine::end_stage() {
  if (stage_.empty()) return;
  const std::string count = total_ > 0  ? fmt::format(" {} of {},", done_, total_)
                            : done_ > 0 ? fmt::format(" {},", done_)
                                        : "";
  out_ << fmt::format("{}{}:{} {:.1f} s{}\n", terminal_ ? kEraseLine : "", stage_, count,
                      clock_() - begin_s_, note_)
       << std::flush;
  stage_.clear();
}

void ProgressLine::rewrite() {
  shown_s_ = clock_();
  const double elapsed_s = shown_s_ - begin_s_;
  out_ << kEraseLine << stage_;
  if (total_ > 0) {
    const double share = static_cast<double>(done_) / total_;
    out_ << fmt::format(" {:3.0f} %", 100.0 * share);
    // The first share of a per cent says nothing about the rest.
    if (share > 0.01)
      out_ << fmt::format(", {} left", clock_text(elapsed_s * (1.0 - share) / share));
  } else if (done_ > 0) {
    out_ << fmt::format(" {}", done_);
  }
  out_ << note_ << std::flush;
}

}  // namespace kinescope
