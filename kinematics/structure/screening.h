// SPDX-License-Identifier: Apache-2.0
//
// Takes   a motion (child in parent) and channel readings.
// Gives   starts for its possible explanations by rest, one turn or one slide, each with a first
//         cost.
// Method  y(t) = log(T0^-1 T(t)) is linear in the coordinate when one joint lies between the
//         bodies; so the six components are regressed on every channel at once (driven joint), or
//         their principal direction is taken (joint that no channel drives). Turns of more than a
//         quarter of a circle to either side are unwrapped along the sorted channel (or along
//         time).
#pragma once

#include <vector>

#include "kinematics/structure/chain.h"

namespace kinescope::structure_search {

/// One explanation to be refined by fit_chain.
struct Candidate {
  ChainModel start;
  int channel = -1;     ///< of a driven joint; -1: rest, or coordinate free
  double cost = 0.0;    ///< -2 ln likelihood, linear approximation
  double across = 1.0;  ///< variance left across the joint, over the declared one
  double share = 0.0;   ///< the same over the variance of the whole motion
};

struct ScreeningOptions {
  bool coordinate_free = true;  ///< also offer joints without a channel
  int max_channels = 3;         ///< best channels kept
};

/// By cost; none where there is no motion. `usable[c]`: channel c may be used.
[[nodiscard]] std::vector<Candidate> screen_motion(const Motion& motion,
                                                   const Eigen::MatrixXd& readings,
                                                   const std::vector<char>& usable,
                                                   const ScreeningOptions& options = {});

/// A start from a body twist (rotation, translation) per unit coordinate at pose T0 (child in
/// parent).
[[nodiscard]] ChainJoint joint_from_twist(const Pose& T0, const Vector6d& twist, JointType type);

}  // namespace kinescope::structure_search
