// SPDX-License-Identifier: Apache-2.0
//
// Gains of the torque channels: measured = gain * (W parameters), a product of unknowns, solved by
// Gauss-Newton with the gains' changes as more columns.
#pragma once

#include <vector>

#include "dynamics/identify/weighted_fit.h"

namespace kinescope::identify {

class GainSystem {
 public:
  /// `reference` keeps the gain 1; -1: the joint with the largest torque. With `wanted` false all
  /// do.
  GainSystem(StackedSystem system, bool wanted, int reference);

  [[nodiscard]] const Eigen::VectorXd& gains() const { return gains_; }
  /// Joints whose gain is estimated, in the order of the last columns.
  [[nodiscard]] const std::vector<Eigen::Index>& free() const { return free_; }

  /// Without the robust part of the loss first, then with it: outliers bend gains like anything
  /// else.
  void find_gains(const WeightedFitOptions& options);
  /// Adds the gains' changes that a fit of final_system() still found. Gives the largest.
  double take(const Eigen::VectorXd& all);

  /// The system whose last columns are the gains' at the solution; without free gains, the plain
  /// one.
  [[nodiscard]] StackedSystem final_system() const;
  /// Options for it: no prior on the gains' changes but 0.
  [[nodiscard]] WeightedFitOptions padded(WeightedFitOptions options) const;

 private:
  void iterate(const WeightedFitOptions& options, int steps, double settled);
  [[nodiscard]] StackedSystem extended() const;

  StackedSystem plain_;
  Eigen::VectorXd gains_;
  std::vector<Eigen::Index> free_;
  Eigen::VectorXd parameters_;
};

}  // namespace kinescope::identify
