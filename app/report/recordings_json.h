// SPDX-License-Identifier: Apache-2.0
//
// What several recordings say beside one another, as calibration.json and result.json have it.
#pragma once

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"

namespace kinescope {

/// `each` recording, and `scatter` of all: rms of postures not seen, of recordings not seen, and
/// what lies between.
[[nodiscard]] nlohmann::json recordings_json(const RunSummary& run);

/// Over all recordings that the others predict, px or m; absent where none is.
struct RecordingScatter {
  double within_rms = 0.0;   ///< by the model of all, at postures that it has not seen
  double unseen_rms = 0.0;   ///< by the others' robot
  double between_rms = 0.0;  ///< what the latter has beyond the former
};
[[nodiscard]] std::optional<RecordingScatter> recording_scatter(const RunSummary& run);

}  // namespace kinescope
