// SPDX-License-Identifier: Apache-2.0
//
// Takes   a log's filtered samples, rigid bodies.
// Gives   spans in which a load acted for longer than what noise and friction are learned over: a
//         payload that was picked up, something that leans on a link. What is learned from a log
//         with such a span in it takes a part of the load for friction, offset and model error.
// Units   s of the log's own clocks.
// Method  change points over all samples: friction, its linear drift and all masses free for the
//         whole log, beside them the torque of a payload, or of a force of constant direction, on
//         one link from one instant to another. The best span by least squares, then a paired test
//         on stretches that the parameters have not seen.
// Not here: when exactly a contact begins and ends (detector.h).
#pragma once

#include <vector>

#include "dynamics/data/torque_samples.h"
#include "dynamics/rigid/rigid_model.h"

namespace kinescope {

struct LastingLoadOptions {
  /// Shorter loads stand out of what is learned by themselves: noise is learned from windows up to
  /// this long (balance_noise.h).
  double shortest_s = 4.0;
  /// More than this share of the log, and it is how the robot is; chosen.
  double most_share = 0.75;
  /// Student's t of the logarithm by which the load makes unseen stretches' squares less. Chosen:
  /// normal variables pass it in 3e-7 of the cases, and some thousand spans are tried.
  double level = 5.0;
  /// Of the squares in its span, what may be left beside the load at most: what masses and friction
  /// lack in one motion, a load mends in part only. Measured logs that nothing touched leave 0.25
  /// and more (build/test/contact logs_free), payloads and pushes on simulated robots with noise of
  /// 1 % leave 0.013 and less.
  double most_left = 0.1;
  int most_loads = 3;
  /// The bodies' masses are those of the robot: they tell whether the log begins with the load or
  /// without it. Else it begins without.
  bool masses_known = true;
};

struct LastingLoad {
  Eigen::Index first = 0;  ///< samples, from this
  Eigen::Index last = 0;   ///< to this
  int body = 0;            ///< that carries it, RigidModel::bodies
  bool is_payload = true;  ///< else a force of constant direction
  double t = 0.0;          ///< of the unseen stretches
};

/// Torques that were not measured and joints that may stick do not count. In the order of time;
/// none in a log that is too short. Costs some regressors of the log and thousands of small solves.
[[nodiscard]] std::vector<LastingLoad> lasting_loads(const RigidModel& model,
                                                     const TorqueSamples& samples,
                                                     const LastingLoadOptions& options = {});

}  // namespace kinescope
