// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibrated bundle and a joint that gives way under its load, gravity not declared.
// Gives   which way things fall.
// Frames  base.
// Method  the direction under which loads of all links' masses explain most of the residual; of its
//         two signs the one that a single mass in the middle of the links prefers. Any of those
//         along which the load does not depend on gravity (a vertical axis's own) explain the same.
#pragma once

#include <vector>

#include "calib/effects/traced_bundle.h"

namespace kinescope::effects {

struct GravityBySag {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< unit vector
  double explained = 0.0;  ///< of the whitened squares, by the sag under it
};

/// `start`: effects of the model beside `sag`, which is a compliance. `bundle` without a declared
/// gravity.
[[nodiscard]] GravityBySag gravity_by_sag(const TracedBundle& bundle,
                                          const std::vector<AddedEffect>& start,
                                          const EffectId& sag);

}  // namespace kinescope::effects
