// SPDX-License-Identifier: Apache-2.0
//
// Measured torque against a model's: is the unit, the sign, the gear or the timing wrong? The model
// may be rough (a nominal URDF without friction); whoever has one supplies its numbers.
#pragma once

#include <vector>

#include "dynamics/data/log_findings.h"
#include "dynamics/data/torque_samples.h"

namespace kinescope {

/// Of one joint.
struct TorqueScale {
  double factor = 0.0;       ///< measured = factor * predicted, least squares
  double correlation = 0.0;  ///< -1 to 1, without friction or offset
  double lag_s = 0.0;        ///< measured comes that much later; 0 where it cannot be told
  double size_ratio = 0.0;   ///< rms of measured over rms of predicted
  /// Friction is so much more than what the model says that errors of its laws pass for the model.
  bool of_friction = false;
};

struct TorqueScales {
  std::vector<TorqueScale> joints;
  std::vector<LogFinding> findings;
};

/// `predicted` as `samples.torque`: samples x joints, Nm or N. The fit leaves an offset and Coulomb
/// and viscous friction free, so that these do not pass for a scale. `drive_scale`: one a joint,
/// the order of what its drive is built for; where the whole torque, friction of any kind included,
/// may be such a drive's, a large factor is none of units. Empty: not known. Findings: a factor of
/// about 1000 or 1/1000 (refusal), a negative one (refusal), a factor common to all joints, a lag
/// over half a sample.
[[nodiscard]] TorqueScales compare_torque_scale(const TorqueSamples& samples,
                                                const Eigen::MatrixXd& predicted,
                                                const Eigen::VectorXd& drive_scale = {});

}  // namespace kinescope
