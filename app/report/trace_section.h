// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "calib/trace/trace_result.h"

namespace kinescope::report {

/// The same for a calibration and for torques; empty where nothing was traced.
[[nodiscard]] std::string trace_section(const Trace& trace);

}  // namespace kinescope::report
