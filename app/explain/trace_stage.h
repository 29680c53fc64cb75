// SPDX-License-Identifier: Apache-2.0
//
// Closing the loop on a calibration: what it lacks is traced, put into it, and it is solved again.
#pragma once

#include "app/explain/pipeline.h"
#include "calib/effects/trace_calibration.h"

namespace kinescope {

struct TracedCalibration {
  Trace trace;
  Calibration calibration;  ///< with the effects that were found
  std::vector<FittedEffect> effects;
  std::optional<Eigen::Vector3d> gravity_base;
  double stamp_jitter_s = 0.0;               ///< CalibrationTrace's
  std::vector<Correction> corrections = {};  ///< of the effects, as the calibration began with them
};

/// What tracing begins with.
struct TraceStart {
  std::vector<AddedEffect> known = {};  ///< effects, which stay if they earn their place
  /// A fit that has what they do, where one without them ends far from it: with the camera that
  /// corners show in place of the declared one.
  std::optional<Calibration> near = {};
};

/// `start` is where `plain` began. The time offset stays estimated whether it is found to matter or
/// not.
[[nodiscard]] TracedCalibration trace_stage(const Recording& recording, const Observed& observed,
                                            const CalibrationStart& start, const Calibration& plain,
                                            const TraceStart& begin,
                                            const CalibrateOptions& options,
                                            const Progress& progress);

}  // namespace kinescope
