// SPDX-License-Identifier: Apache-2.0
//
// Which samples a model learns from and which it is judged on. Not single samples by lot, unless
// published figures are to be compared with: neighbours in time are nearly equal, and a model is
// then judged on what it has seen. Whole trajectories are held out, and trajectories that repeat
// one path stay together; where there is one path only, contiguous blocks are held out, with a gap
// to what is learned from.
#pragma once

#include <cstdint>
#include <vector>

#include "dynamics/data/log_findings.h"
#include "dynamics/data/torque_samples.h"

namespace kinescope {

struct SplitOptions {
  int folds = 10;        ///< at most; fewer where there are fewer groups of trajectories
  double guard_s = 0.5;  ///< between a held-out block and the samples learned from
  bool keep_repeats_together = true;  ///< trajectories of one path in one fold
};

/// Row numbers, ascending.
struct Fold {
  std::vector<Eigen::Index> train, test;
};

struct Folds {
  std::vector<Fold> folds;
  bool by_trajectory = false;        ///< else by blocks
  std::vector<LogFinding> findings;  ///< trajectories that repeat a path
};

/// Every sample whose torques were measured is in the test part of exactly one fold, the others in
/// none. The same for the same samples, whatever
/// the order of the trajectories. Throws undetermined for less than two folds' worth of samples.
[[nodiscard]] Folds split_folds(const TorqueSamples& samples, const SplitOptions& options = {});

/// One fold whose test part is about `share` of the samples: the last trajectories, or the last
/// block.
[[nodiscard]] Fold split_last(const TorqueSamples& samples, double share = 0.3,
                              const SplitOptions& options = {});

/// One fold whose test part is `share` of the samples by lot, as published tables often have it. It
/// flatters: every test sample has neighbours that were learned from. Throws as split_last().
[[nodiscard]] Fold split_at_random(const TorqueSamples& samples, double share, std::uint64_t seed);

/// For each trajectory, the number of the first one that follows the same path (its own where none
/// does): every posture of the shorter lies within 1 % of the joints' ranges of a posture of the
/// other, at nine of ten samples.
[[nodiscard]] std::vector<int> repeated_paths(const TorqueSamples& samples);

/// Rows in which the torques of all joints were measured, and these as samples of their own.
[[nodiscard]] std::vector<Eigen::Index> measured_rows(const TorqueSamples& samples);
[[nodiscard]] TorqueSamples measured_part(const TorqueSamples& samples);

/// Samples behind a gap in their trajectory as a trajectory of their own, of the same name.
[[nodiscard]] TorqueSamples split_at_gaps(TorqueSamples samples);

/// The rows as samples of their own; trajectory numbers are kept.
[[nodiscard]] TorqueSamples select_rows(const TorqueSamples& samples,
                                        const std::vector<Eigen::Index>& rows);

}  // namespace kinescope
