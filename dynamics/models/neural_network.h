// SPDX-License-Identifier: Apache-2.0
//
// The network that papers on inverse dynamics compare with: two hidden layers of 400 sigmoids
// (Dalla Libera and Carli 2020, section V), by dlib. It knows nothing of the robot.
#pragma once

#include "dynamics/models/torque_model.h"

namespace kinescope::models {

/// One network of (q, dq, ddq), standardised, for all joints. Adam on batches; the rate of learning
/// is halved where the error on held-out trajectories no longer falls, and the weights that were
/// best there are kept (Prechelt 1998). Sigma is the error there. Throws undetermined where there
/// are too few samples to hold some out.
[[nodiscard]] FittedTorqueModel fit_neural_network(const TorqueSamples& samples,
                                                   const NeuralNetworkOptions& options,
                                                   std::uint64_t seed);

}  // namespace kinescope::models
