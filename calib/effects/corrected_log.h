// SPDX-License-Identifier: Apache-2.0
//
// Takes   a joint log, the robot, the effects that tracing found on it.
// Gives   the log as encoders without those effects would have written it: channels in their own
//         units, stamps on the camera's clock.
// Method  the shares of the effects (camera_effects.h) at the log's own samples, faded out beyond
//         the range in which each was observed (observed_range.h).
// Not here: effects that no encoder could have logged (axes that wobble, markers, the camera).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/effects/trace_calibration.h"

namespace kinescope {

/// An effect that was undone in part: a joint leaves the range in which it was observed.
struct FadedEffect {
  EffectId id;
  JointId joint;  ///< whose value it depends on
  JointLimits range;
  JointLimits reached;  ///< by the joint, its range included
};

struct CorrectedLog {
  JointLog log;
  std::vector<EffectId> undone;
  std::vector<EffectId> left;  ///< those that a log cannot show
  /// Those undone that the log leaves by more than a hundredth of their range: less changes
  /// nothing.
  std::vector<FadedEffect> faded;
};

/// Throws bad_input for an effect at a joint that the tree or the log does not have.
[[nodiscard]] CorrectedLog corrected_log(const JointLog& log, const KinematicTree& tree,
                                         const std::vector<FittedEffect>& effects,
                                         const std::optional<Eigen::Vector3d>& gravity_base);

}  // namespace kinescope
