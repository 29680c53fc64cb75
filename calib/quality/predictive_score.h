// SPDX-License-Identifier: Apache-2.0
//
// Takes   a Calibration and the measurements that it is of.
// Gives   how probable the model makes what it has not seen: the one figure by which whole
//         explanations of a recording, with whatever structure, camera and effects, are compared.
// Method  Student's t about the held-out predictions (Lange, Little and Taylor 1989), its scale as
//         probable as it can be: noise needs no declaration, outliers cost little and bounded
//         surprise. A sighting that a model has no place for may be anywhere.
#pragma once

#include "calib/bundle/calibration.h"
#include "calib/bundle/measurements.h"

namespace kinescope {

struct PredictiveScore {
  double deviance = 0.0;  ///< -2 ln of the likelihood of all sightings
  double alike = 1.0;     ///< frames that count as one, their residuals being alike
};

[[nodiscard]] PredictiveScore predictive_score(const Calibration& calibration,
                                               const Measurements& measurements);

/// Student's scale of a coordinate of a square's corners about the predictions of frames that the
/// model has not seen, px; 0 where no such corner is predicted.
[[nodiscard]] double scale_of_corners(const Calibration& calibration);

/// ln of the odds of one model against another of the same measurements.
[[nodiscard]] double log_odds(const PredictiveScore& of, const PredictiveScore& against);

}  // namespace kinescope
