// SPDX-License-Identifier: Apache-2.0
//
// Takes   a robot of filmed_robot.h and a joint log that it was made to follow.
// Gives   the World of that recording.
#pragma once

#include <functional>

#include "tests/truth/filmed_robot.h"
#include "tests/truth/rig_world.h"

namespace kinescope::truth {

struct CommandedOptions {
  RigCamera camera;         ///< its name and bump are not used
  std::uint64_t noise = 1;  ///< seed of it
  double begin_s = 0.0;     ///< of the frames, on the log's clock
  double end_s = 0.0;
  /// The log's rows are postures at rest, one frame each; begin, end and rate are not looked at.
  bool postures = false;
  /// What the joints do where the log says this; empty: just that.
  std::function<Eigen::VectorXd(const Eigen::VectorXd& logged)> moved = {};
};

[[nodiscard]] World commanded_world(const FilmedRobot& robot, const JointLog& log,
                                    const CommandedOptions& options);

}  // namespace kinescope::truth
