// SPDX-License-Identifier: Apache-2.0
//
// A finished run beside its truth: structure, places of the turning axes, what was traced.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "app/commands/commands.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

struct JudgedRun {
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

enum class Markers { kAllFound, kThoseFound };

/// Runs `options` into `folder`, and compares. Markers::kThoseFound: the truth has some that no
/// camera sees.
[[nodiscard]] JudgedRun judged_run(RunOptions options, const std::filesystem::path& folder,
                                   const KinematicTree& truth,
                                   Markers markers = Markers::kAllFound);

[[nodiscard]] double rms(const std::vector<double>& values);

void print_header(const std::string& first);
void print_line(const std::string& what, const JudgedRun& judged);

}  // namespace kinescope
