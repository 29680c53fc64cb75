// SPDX-License-Identifier: Apache-2.0
//
// Takes   what was seen of a recording.
// Gives   Explanation: one whole account of it, from the structure to the effects; of several, the
//         one under which the measurements are the most probable.
// Method  The stages propose one after the other. Where what they end with is not of one piece (a
//         structure in doubt, a fit that did not settle, something left that nothing explains),
//         moves propose other wholes: the structure asked again with the effects undone, the camera
//         doubted, a reading put aside. Each is fitted and traced in full, and the predictive score
//         (calib/quality/predictive_score.h) decides.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/explain/pipeline.h"
#include "app/explain/trace_stage.h"
#include "calib/quality/freedom_levels.h"

namespace kinescope {

struct Explanation {
  JointLog log;                        ///< without the readings that were put aside
  PoseTracks tracks;                   ///< without the sightings that they would have explained
  std::optional<Structure> structure;  ///< none: a nominal robot was given
  std::vector<NominalFault> nominal_faults;  ///< mended before the fit
  std::vector<FreedomLevel> levels;          ///< of a nominal robot: what each freedom predicts
  CalibrationStart start;
  std::optional<TracedCalibration> fitted;  ///< none where nothing could be fitted
  std::optional<Error> failure;             ///< why
};

struct Evidence {
  const Recording& recording;
  const Observed& observed;
  const PoseTracks& tracks;  ///< as the camera shows them; empty for points
  CameraModel camera;        ///< declared, or found from the motion
  /// That the tracks alone show, where it was found already.
  std::optional<Structure> structure = {};
};

struct ExplainOptions {
  CalibrateOptions calibrate;
  /// Of a nominal robot; none: what predicts best.
  std::optional<FreeGeometry> free = {};
  bool trace = true;
  /// Called at the end of a stage, with its name.
  std::function<void(std::string_view)> lap;
  Progress progress;
};

/// Throws what reading and declarations are wrong by; what the data cannot determine is in the
/// answer. `warnings` receives what was assumed.
[[nodiscard]] Explanation explain(const Evidence& evidence, const ExplainOptions& options,
                                  std::vector<std::string>& warnings);

}  // namespace kinescope
