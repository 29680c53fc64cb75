// SPDX-License-Identifier: Apache-2.0
//
// Takes   calibrations of one nominal robot by the same measurements, with more and more of it
//         free.
// Gives   which of them predicts best what it has not seen, and how well each one does.
// Method  the predictive score of what was held out; few postures bear few parameters, and a
//         robot that is only placed may predict better than one that was bent to fit.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "calib/bundle/calibrate.h"
#include "calib/quality/error_summary.h"

namespace kinescope {

struct FreedomLevel {
  FreeGeometry free = FreeGeometry::kGeometry;
  int effects = 0;  ///< that were traced, beside the robot
  CalibrationStatus status = CalibrationStatus::kNotRun;
  ErrorRow errors;        ///< over the sightings that the exported one did not reject
  double log_odds = 0.0;  ///< of its predictions, against those of the exported one
  bool exported = false;
};

/// A calibration and what was free in it.
struct LevelFit {
  FreeGeometry free = FreeGeometry::kGeometry;
  int effects = 0;
  const Calibration* calibration = nullptr;  ///< must outlive it
};

/// The index of the fit under which the measurements, held out, are the most probable; of none that
/// converged, or where nothing was held out, the last.
[[nodiscard]] std::size_t best_level(const std::vector<LevelFit>& fits,
                                     const Measurements& measurements);

[[nodiscard]] std::vector<FreedomLevel> compare_levels(const std::vector<LevelFit>& fits,
                                                       std::size_t exported,
                                                       const Measurements& measurements);

/// "only placed", "joint zeros free", "geometry free", "geometry free and 2 effects".
[[nodiscard]] std::string words_of(const FreedomLevel& level);

}  // namespace kinescope
