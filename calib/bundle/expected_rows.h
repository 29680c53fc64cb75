// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibration read back from its file, and what a recording that is yet to be made would
//         show of the same robot.
// Gives   how those measurements would answer to the robot's parameters: whitened Jacobian rows,
//         frame by frame; and what a covariance of the parameters says of the axes.
// Frames  parameters are those of the calibration: same names, units, frames and gauge. Camera,
//         clock and (where they were estimated) intrinsics are the new recording's own.
// Method  the bundle's own residuals (linearise.h) at the calibrated robot.
// Not here: which recording to make (calib/design).
#pragma once

#include <vector>

#include <Eigen/Core>

#include "calib/bundle/calibration.h"
#include "calib/bundle/correction.h"
#include "calib/bundle/measurements.h"
#include "kinematics/log/joint_log.h"

namespace kinescope {

/// A recording to be. Times of the frames are on the log's clock.
struct ExpectedRecording {
  Measurements measurements;  ///< corners or points, free of noise; one camera
  JointLog log;               ///< channels in the units of the tree's scales
  bool postures = false;      ///< the robot rests in every frame, and no clock is to be found
  std::vector<Correction> corrections;  ///< effects that the model has; shares by these frames
};

struct ExpectedRows {
  /// Those of the robot in the calibration's order (effects that `corrections` lacks are left out),
  /// effects that the calibration lacks, then the recording's own.
  std::vector<Parameter> parameters;
  std::vector<Eigen::MatrixXd> J;  ///< by frame: rows x parameters; no rows where nothing is seen
};

/// True for a parameter of one recording alone: of a camera, a clock, a lens.
[[nodiscard]] bool is_of_recording(const Parameter& parameter);

/// Throws undetermined where nothing would be seen.
[[nodiscard]] ExpectedRows expected_rows(const Calibration& calibration,
                                         const ExpectedRecording& recording);

/// How well each axis is known with this covariance of `parameters`, all joints at `values`; one
/// entry a joint of the tree, only the sigmas of axes are filled (axis_uncertainty.h).
[[nodiscard]] std::vector<JointEstimate> axes_by_covariance(
    const Calibration& calibration, const std::vector<Parameter>& parameters,
    const Eigen::MatrixXd& covariance, const Eigen::VectorXd& values);

}  // namespace kinescope
