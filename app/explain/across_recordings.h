// SPDX-License-Identifier: Apache-2.0
//
// Takes   the calibration of several recordings together.
// Gives   what each of them says beside the others: its error by the model of all and by a robot
//         that it had no part in, its clock, where its markers sit.
// Method  leave one recording out: robot and effects are fitted to the others and held; camera,
//         mounts and clock of the one left out are fitted on its other folds, as compare does
//         (carry_over.h). The scatter between recordings is what its error has beyond that of
//         unseen postures.
#pragma once

#include <vector>

#include "app/explain/explain.h"
#include "app/report/run_summary.h"

namespace kinescope {

/// Empty where there is one recording.
[[nodiscard]] std::vector<RecordingSummary> across_recordings(const Evidence& evidence,
                                                              const Explanation& of,
                                                              CalibrateOptions options);

}  // namespace kinescope
