// SPDX-License-Identifier: Apache-2.0
//
// The physical verdict on a torque model: the measured torques of a log drive the model from
// measured states, open loop; how far is it from the measured motion after a while?
#pragma once

#include <string>
#include <vector>

#include "dynamics/data/torque_samples.h"
#include "dynamics/simulation/plant.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

struct RolloutOptions {
  std::vector<double> horizons_s = {0.1, 0.5, 2.0};
  int most_windows = 16;  ///< of each horizon, evenly over the log; they may overlap by half
  double step_s = 2e-3;   ///< of the integration, at most
};

/// How far a model is at the end of its windows: the median of them, which one window in which
/// a joint stuck or slipped does not decide.
struct RolloutError {
  Eigen::VectorXd joints;  ///< rad or m
  double tool_m = 0.0;     ///< of the tree's tip; NaN where there is none
};

struct RolloutHorizon {
  double horizon_s = 0.0;
  int windows = 0;
  RolloutError with_effects;
  RolloutError without_effects;  ///< the same bodies, with the friction that the robot's file has
  RolloutError held;             ///< nothing moved: what the motion itself is over the horizon
};

struct Rollout {
  std::vector<RolloutHorizon> horizons;  ///< those that the log is long enough for
  std::string tip;                       ///< link whose place is the tool's; empty: none
  std::string failure;                   ///< why there is none; empty: there is
};

/// `samples`: filtered motion and torques, N m. `tree` gives the tool. Deterministic;
/// O(windows x horizon / step).
[[nodiscard]] Rollout roll_out(const CorrectedTorqueModel& model, const KinematicTree& tree,
                               const TorqueSamples& samples, const RolloutOptions& options = {});

}  // namespace kinescope
