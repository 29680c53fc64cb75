// SPDX-License-Identifier: Apache-2.0
//
// The learner that papers on inverse dynamics compare with: epsilon-SVR with a Gaussian kernel
// (Smola and Schoelkopf 2004), by LIBSVM. It knows nothing of the robot.
#pragma once

#include "dynamics/models/torque_model.h"

namespace kinescope::models {

/// Of (q, dq, ddq), standardised, one machine a joint. Penalty, width and tube are chosen by
/// cross-validation over contiguous blocks; sigma is the error there.
[[nodiscard]] FittedTorqueModel fit_support_vectors(const TorqueSamples& samples);

}  // namespace kinescope::models
