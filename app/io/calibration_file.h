// SPDX-License-Identifier: Apache-2.0
//
// calibration.json, read back as the calibration that it was written of.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "calib/bundle/calibration.h"

namespace kinescope {

/// Tree, camera, clock, parameters with their covariance, ranges of the joints, errors; what the
/// file does not hold (residuals, values of the joints over time) is empty. Throws bad_input: no
/// such file, no JSON, another schema or version, numbers that are none or do not fit together.
[[nodiscard]] Calibration parse_calibration(std::string_view text, const std::string& source);
[[nodiscard]] Calibration read_calibration(const std::filesystem::path& calibration_json);

}  // namespace kinescope
