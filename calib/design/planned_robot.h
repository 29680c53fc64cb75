// SPDX-License-Identifier: Apache-2.0
//
// Takes   a finished calibration with its effects, how its markers are found.
// Gives   what a recording of given postures, or along a motion, would show of it.
// Units   readings are those of JointSpace.
#pragma once

#include <optional>
#include <vector>

#include "calib/bundle/expected_rows.h"
#include "calib/design/joint_space.h"
#include "calib/design/sight.h"
#include "calib/effects/trace_calibration.h"

namespace kinescope::design {

/// An effect whose share in a recording can be told.
struct ConsideredEffect {
  EffectId id;
  double scan = 0.0;
  Eigen::VectorXd values;      ///< of its parameters; empty: not known
  Eigen::VectorXd references;  ///< as FittedEffect
};

struct PlannedRobot {
  Calibration calibration;
  std::vector<ConsideredEffect> effects;  ///< that the calibration has
  std::vector<ConsideredEffect> rivals;   ///< that it has not, and that may stand in their place
  std::optional<Eigen::Vector3d> gravity_base;
  SightLimits sight;
  MarkerNoise noise;
};

/// One frame a posture, at rest.
[[nodiscard]] ExpectedRecording recording_at(const PlannedRobot& robot, const JointSpace& space,
                                             const std::vector<Eigen::VectorXd>& postures);

/// Frames from the motion's beginning to its end.
[[nodiscard]] ExpectedRecording recording_along(const PlannedRobot& robot, const JointSpace& space,
                                                const RestToRestPath& path, double frame_rate_hz);

/// What an effect changes in this recording, one correction a parameter; empty: nothing (effects of
/// another recording alone, a robot without that place).
[[nodiscard]] std::vector<Correction> corrections_of(const PlannedRobot& robot,
                                                     const ExpectedRecording& recording,
                                                     const ConsideredEffect& effect);

}  // namespace kinescope::design
