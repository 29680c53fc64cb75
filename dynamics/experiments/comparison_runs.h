// SPDX-License-Identifier: Apache-2.0
//
// Learners side by side over settings (how far a geometry is misplaced, how much was learned from)
// and runs (random worlds, parts of a log).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "dynamics/experiments/learners.h"
#include "kinematics/core/progress.h"

namespace kinescope::experiments {

/// What is learned from, what is judged on, and the kinematics that the learners are told.
struct ComparisonCase {
  DynamicModel believed;
  TorqueSamples train;
  TorqueSamples test;
};

struct ComparisonPlan {
  int settings = 1;
  int runs = 20;
  std::vector<Learner> learners;
  /// The same case for the same numbers, whenever it is asked for.
  std::function<ComparisonCase(int setting, int run)> make;
  LearnOptions learn;
  bool judge_trajectories = false;  ///< each of the test's by itself, a trial of its own
};

struct Trial {
  int setting = 0;
  int run = 0;
  int trajectory = 0;  ///< of the test, that it is judged on; 0 where all are judged together
  Learner learner = Learner::kGip;
  /// Mean squared error over the variance of the test's torque, one a joint, per cent.
  Eigen::VectorXd nmse_percent;
  /// Sum of all joints' squared errors over the sum of their variances, per cent.
  double global_nmse_percent = 0.0;
  /// Share of the test's samples whose joint values all lie within the range learned from, per
  /// cent.
  double inside_percent = 0.0;
  std::string failure = {};  ///< why there are no errors (they are NaN then); else empty
};

/// In the order of settings, runs, learners, trajectories. What cannot be learned (too few samples)
/// gets its reason.
[[nodiscard]] std::vector<Trial> run_comparison(const ComparisonPlan& plan,
                                                const Progress& progress = {});

/// Share of the rows of `test` within the column ranges of `train`, per cent.
[[nodiscard]] double inside_percent(const Eigen::MatrixXd& train, const Eigen::MatrixXd& test);

}  // namespace kinescope::experiments
