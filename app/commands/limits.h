// SPDX-License-Identifier: Apache-2.0
//
// Limits of --fail-on: "held_out_px>0.2" turns the exit code to 5 when the run's value is over it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "app/commands/console.h"
#include "app/report/answer.h"

namespace kinescope {

struct Limit {
  std::string quantity;
  char comparison = '>';  ///< '>' or '<': what counts as outside
  double value = 0.0;
};

/// Throws bad_request for a quantity we do not know (and names those we do) or a text that is no
/// limit.
[[nodiscard]] std::vector<Limit> parse_limits(const std::vector<std::string>& texts);

/// Tells the console every limit that is passed.
[[nodiscard]] bool within_limits(const RunSummary& run, const std::vector<Limit>& limits,
                                 const Console& console);

/// Throws undetermined when tracing was able to say nothing.
void require_trace(const RunSummary& run);

/// Throws undetermined where there is no answer. `see` says where the details are. Called once
/// everything is written.
void require(const Answer& answer, std::string_view see);

}  // namespace kinescope
