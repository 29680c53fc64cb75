// SPDX-License-Identifier: Apache-2.0
//
// Takes   how to fit a nominal robot with more or less of it free, and how to trace what that
// lacks. Gives   the fit that predicts best what it has not seen, with effects or without, and how
// all of
//         them compare.
// Method  calib/quality/freedom_levels.h.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "app/explain/trace_stage.h"
#include "calib/quality/freedom_levels.h"

namespace kinescope {

struct NominalFit {
  TracedCalibration best;
  std::vector<FreedomLevel> levels;
};

/// Effects are looked for beside the freest level, and beside the one that predicts best without
/// any; `only`: beside that one alone, which is then the answer.
[[nodiscard]] NominalFit fit_nominal(
    const Measurements& measurements, std::optional<FreeGeometry> only,
    const std::function<Calibration(FreeGeometry)>& calibrated,
    const std::function<TracedCalibration(FreeGeometry, const Calibration&)>& traced);

}  // namespace kinescope
