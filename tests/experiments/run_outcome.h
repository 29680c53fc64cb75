// SPDX-License-Identifier: Apache-2.0
//
// `run` on a recording of a robot that is known, judged: structure, axes, error on unseen data.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "app/commands/commands.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

struct Outcome {
  int code = 0;
  bool structure = false;
  double held_out_px = 0.0;
  /// Of the turning axes' places among each other, rms: one standard uncertainty, and the error.
  double claimed_mm = 0.0;
  double true_mm = 0.0;
  int within = 0;  ///< axes whose error is within twice their standard uncertainty
  int axes = 0;
  std::string verdict;
  std::string effects;
};

/// Into `folder`. The axes are compared where the structure is right; every channel at zero.
[[nodiscard]] Outcome run_and_judge(RunOptions options, const std::filesystem::path& folder,
                                    const KinematicTree& truth);

[[nodiscard]] double rms(const std::vector<double>& values);

}  // namespace kinescope
