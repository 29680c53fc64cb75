// SPDX-License-Identifier: Apache-2.0
//
// Takes   a RunSummary: structure, calibration, what tracing found.
// Gives   Answer: whether the run has one. Exit code, products, console and report follow it, and
//         nothing else.
#pragma once

#include <string>

#include "app/report/run_summary.h"

namespace kinescope {

struct Answer {
  bool given = true;
  /// Where it is not given: what cannot be told, of which stage, and what to do about it.
  std::string where;
  std::string what;
  std::string remedy;
};

[[nodiscard]] Answer judge(const RunSummary& run);

}  // namespace kinescope
