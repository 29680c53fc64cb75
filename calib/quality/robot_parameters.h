// SPDX-License-Identifier: Apache-2.0
//
// The robot of a calibration as a function of the parameters that were estimated: what carries
// their covariance over to other numbers of the robot.
#pragma once

#include <Eigen/Core>

#include "calib/bundle/calibration.h"

namespace kinescope {

/// Whether a number was estimated, and if not why.
enum class NumberState {
  kEstimated,
  kHeld,          ///< as declared
  kUndetermined,  ///< the recording does not show it
  kNoChannel,     ///< of a joint that no channel drives: nothing says where it stood
  kOwnUnit        ///< of a channel whose unit and zero are another log's own
};

/// By which a parameter is moved for a central difference: in its own unit, of scales (whose unit
/// is whatever a channel counts in) relative.
[[nodiscard]] double parameter_step(const KinematicTree& tree, const Parameter& parameter);

/// Moves the joint that the parameter is of by `step`. False: it is none of a joint's frame, zero
/// or scale, and nothing was moved.
[[nodiscard]] bool move_robot(KinematicTree& tree, const Calibration& run,
                              const Parameter& parameter, double step);

/// Whether a derivative (by a parameter in its own unit) is more than rounding.
[[nodiscard]] bool has_influence(double derivative);

/// Of a number with these derivatives by run.parameters.
[[nodiscard]] NumberState number_state(const Eigen::RowVectorXd& derivatives,
                                       const Calibration& run);

}  // namespace kinescope
