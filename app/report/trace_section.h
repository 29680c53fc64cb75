// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "calib/trace/trace_result.h"

namespace kinescope::report {

/// The same for a calibration and for torques; empty where nothing was traced. `further`: a
/// sentence of what to do with what was found.
[[nodiscard]] std::string trace_section(const Trace& trace, const std::string& further = "");

}  // namespace kinescope::report
