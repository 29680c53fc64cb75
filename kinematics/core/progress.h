// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string_view>

namespace kinescope {

/// Called by long stages: what is done, how many of how many (total 0: not known). Rooms below
/// `app` print nothing; they call this. May be empty.
using Progress = std::function<void(std::string_view stage, int done, int total)>;

inline void report_progress(const Progress& progress, std::string_view stage, int done, int total) {
  if (progress) progress(stage, done, total);
}

}  // namespace kinescope
