// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibration and a Denavit-Hartenberg chain of its robot.
// Gives   standard uncertainties of the chain's numbers.
// Method  the calibration's covariance carried over by the numbers' Jacobian (central differences).
//         Base and tool are as uncertain as the base frame and the tip's own frame let them be
//         (Calibration::gauge).
#pragma once

#include <array>
#include <vector>

#include "calib/bundle/calibration.h"
#include "calib/quality/robot_parameters.h"
#include "kinematics/model/denavit_hartenberg.h"

namespace kinescope {

/// A number of a step: its standard uncertainty, and why it has none.
struct DhNumber {
  Sigma sigma;
  NumberState state = NumberState::kHeld;
  bool operator==(const DhNumber&) const = default;
};

struct DhUncertainty {
  /// Beside DhChain::steps: theta, d, a, alpha, beta (rad, m).
  std::vector<std::array<DhNumber, 5>> steps;
  /// Of base and tool, of the error's length as JointEstimate has it.
  Sigma base_rotation_rad, base_translation_m;
  Sigma tool_rotation_rad, tool_translation_m;
};

/// Numbers that are ill-conditioned (DhNormal::kOneLine) are kUndetermined.
[[nodiscard]] DhUncertainty dh_uncertainty(const Calibration& calibration, const DhChain& chain);

}  // namespace kinescope
