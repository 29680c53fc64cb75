// SPDX-License-Identifier: Apache-2.0
//
// Takes   a chain fitted to the motion of a body in a link's frame.
// Gives   what that explanation costs (-2 ln likelihood, -2 ln prior), and what none costs.
#pragma once

#include "kinematics/structure/link_path.h"

namespace kinescope::structure_search {

/// Arm (m) at which rotations are compared with translations.
inline constexpr double kLever = 0.3;

/// RMS of the motion about its mean, m; rotations at kLever. 0 for none.
[[nodiscard]] double motion_size(const Motion& motion);

/// -2 ln likelihood of all `seen` sightings, as those in `relative` tell it for their share.
[[nodiscard]] double data_cost_of(const ChainFit& fit, const RelativeMotion& relative, int seen);

/// -2 ln prior of a channel that moves a further joint: 1 joint in 100 has one, which is one choice
/// of many.
[[nodiscard]] double price_of_further_channel(const Readings& readings);

/// For parameters (Schwarz 1978), the choice of channels, and what is known of scales and sizes
/// before.
[[nodiscard]] double penalty_of(const ChainFit& fit, const Readings& readings);

/// What a body costs that moves freely in the camera's frame.
struct FreeCost {
  double as_seen = 0.0;     ///< a Gaussian with the covariance that the motion happens to have
  double everywhere = 0.0;  ///< as far in every direction as in the mean of all: a free body has no
                            ///< reason to keep to a line
};
[[nodiscard]] FreeCost free_cost(const Body& body, const Readings& readings);

}  // namespace kinescope::structure_search
