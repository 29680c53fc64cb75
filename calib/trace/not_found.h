// SPDX-License-Identifier: Apache-2.0
//
// What was looked for and not found: from which size on it would have been.
#pragma once

#include <vector>

#include "calib/trace/stage.h"
#include "calib/trace/trace.h"

namespace kinescope::trace {

/// Of all candidates of the stage that `trace` neither accepts nor has among its ambiguities.
/// `level`: of all tests together.
[[nodiscard]] std::vector<NotFoundEffect> not_found(const Stage& stage, const Trace& trace,
                                                    const TraceOptions& options, double level);

}  // namespace kinescope::trace
