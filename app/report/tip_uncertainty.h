// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibration.
// Gives   how exactly its robot says where the last link is: the marker at the end of the longest
//         chain, over the postures of the recording.
// Frames  the base of the robot (Calibration::gauge); lengths in m, turns in rad.
// Method  the calibration's covariance carried over by the Jacobian of the marker's pose (central
//         differences).
// Not here: what is common to the whole recording (declared marker size and intrinsics), and what
//         the model lacks.
#pragma once

#include <optional>

#include "calib/bundle/calibration.h"

namespace kinescope::report {

/// Standard uncertainties of an error's length as JointEstimate has them: twice it holds the error
/// in 95 of 100 cases. Root mean squares over the postures. Of points, which show no turn, without
/// rotation.
struct TipFigures {
  double translation_m = 0.0;
  Sigma rotation_rad;
};

struct TipUncertainty {
  TagId marker;
  LinkId link;
  int joints = 0;                        ///< that move it
  TipFigures in_base;                    ///< in the base's frame, as the URDF has it
  double worst_m = 0.0;                  ///< the same at the posture where it is largest
  std::optional<TipFigures> among = {};  ///< after the motion of the base that makes the errors of
                                         ///< the marker's places smallest (as in design::goal_root)
};

/// Nothing where no joint moves a marker, the fit has no covariance, the data do not determine what
/// the marker's pose depends on, a joint on the way has no channel (nothing says where it stands),
/// or no joint frame on the way was estimated.
[[nodiscard]] std::optional<TipUncertainty> tip_uncertainty(const Calibration& calibration);

}  // namespace kinescope::report
