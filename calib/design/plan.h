// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibrated robot (planned_robot.h), what its joints may do (joint_space.h), what is to
//         become known (goal.h), how long the recording may be.
// Gives   the postures or the motion that tells most, and the uncertainty after it.
// Units   readings in the units of the tree's channels; m, rad, s.
// Method  optimal design of a linearised experiment (Fedorov 1972; of robots Borm and Menq 1991;
//         Sun and Hollerbach 2008): candidate postures drawn over the joints' ranges, exchange
//         (exchange.h) on the sum of what is known and what each would add; rivals first, by
//         T-optimality (rivals.h). A motion goes through such postures, and its promise is that of
//         its own frames. Camera pose, clock and lens of the recording are its own unknowns.
// Not here: torques (dynamics/identify).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/design/goal.h"
#include "kinematics/core/progress.h"

namespace kinescope::design {

struct PlanOptions {
  Goal goal = Goal::kTip;
  int postures = 0;      ///< of a plan of postures at rest, one frame each
  double seconds = 0.0;  ///< else of a motion
  double frame_rate_hz = 30.0;
  int candidates = 500;  ///< postures that are looked at; more is slower and hardly better
  std::uint64_t seed = 1;
};

/// What is known, or will be.
struct Promise {
  double goal_m = 0.0;  ///< root mean square error of a point of the goal
  std::vector<JointEstimate>
      axes;  ///< beside the joints: sigmas alone, in the middle of the ranges
};

struct RivalPromise {
  EffectId believed, other;
  /// What the other leaves of the believed one in the new recording alone, in standard deviations;
  /// both recordings together leave no less. None: such a recording does not show the two.
  std::optional<double> sigmas_apart;
};

struct RecordingPlan {
  std::vector<Eigen::VectorXd> postures;  ///< readings, in the order of the motion
  std::optional<RestToRestPath> path;     ///< none: postures alone
  Promise before, after;
  /// The covariance that is promised, of the robot's and the recording's parameters.
  std::vector<Parameter> parameters;
  Eigen::MatrixXd covariance;
  std::vector<RivalPromise> rivals;
  std::map<TagId, int> sightings;  ///< frames in which each marker is expected
  int frames = 0;
  double seen_share = 0.0;  ///< of the postures that were drawn, those that show any marker
};

/// Pairs of rivals are indices of robot.effects and robot.rivals. Throws undetermined where no
/// posture within the ranges shows a marker, or the motion is too short for two of them.
[[nodiscard]] RecordingPlan plan_recording(
    const PlannedRobot& robot, const JointSpace& space,
    const std::vector<std::pair<std::size_t, std::size_t>>& pairs, const PlanOptions& options,
    const Progress& progress = {});

}  // namespace kinescope::design
