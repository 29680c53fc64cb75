// SPDX-License-Identifier: Apache-2.0
//
// Joints whose torque has the other sign than the other joints'. Links are carried by all joints
// before them, so that their parameters are shared: torques of both signs contradict each other,
// whatever the masses are. A joint whose friction clearly takes energy is not turned.
#pragma once

#include <vector>

#include "dynamics/identify/identify.h"

namespace kinescope {

/// Log likelihood of the base parameters' fit with the torques of `joints` turned, less that of
/// their fit as logged, for as many independent samples as the residual's correlation leaves.
/// Positive: turned they agree better. Throws as identify_dynamics().
[[nodiscard]] double evidence_of_turning(const DynamicModel& model, const TorqueSamples& samples,
                                         const IdentifyOptions& options,
                                         const std::vector<int>& joints);

/// Log likelihood difference from which on a turned torque is taken for certain: a chance of one in
/// a thousand, for each of the joints that are asked about.
[[nodiscard]] double clear_evidence(Eigen::Index joints);

/// The joints to turn, ascending: one after the other, the one with the most evidence, while that
/// is clear and motion left out of the fit is predicted better, too. Always less than half of them:
/// all others turned agree as well, and which part it is only masses say. At most joints^2 / 2
/// identifications of 1000 samples. Empty: none, or too few samples.
[[nodiscard]] std::vector<int> find_turned_torques(const DynamicModel& model,
                                                   const TorqueSamples& samples,
                                                   const IdentifyOptions& options);

}  // namespace kinescope
