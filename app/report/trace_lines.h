// SPDX-License-Identifier: Apache-2.0
//
// What tracing found, in sentences: for the console and the head of the report's section.
#pragma once

#include <string>
#include <vector>

#include "calib/effects/second_column.h"
#include "calib/trace/trace_result.h"

namespace kinescope {

/// One line a finding: the verdict, then the effects with size, interval and what they do to the
/// error. Ends with what to record where the recording cannot tell.
[[nodiscard]] std::vector<std::string> trace_lines(const Trace& trace);

/// One sentence a column: how it differs from the joint's own.
[[nodiscard]] std::vector<std::string> second_column_lines(
    const std::vector<SecondColumn>& columns);

}  // namespace kinescope
