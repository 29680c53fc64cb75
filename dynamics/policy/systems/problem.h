// SPDX-License-Identifier: Apache-2.0
//
// A system with what is asked of a policy on it, and when that counts as done.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "dynamics/policy/mc_pilco.h"

namespace kinescope::policy {

/// A mechanism as a line drawing, from its positions (P).
struct Skeleton {
  /// 2 x N, m: the joints of the moving polyline; the last one is its tip. Empty: no drawing.
  std::function<Eigen::Matrix2Xd(const Eigen::VectorXd& positions)> moving;
  Eigen::Matrix2Xd fixed;  ///< m: a polyline that does not move
};

struct PolicyProblem {
  std::string name;
  std::shared_ptr<const System> system;
  PolicyTask task;
  LearnerOptions learner;
  /// P: where every position stays within it of its target (cost.h) over the last second, a trial
  /// is a success; infinite: of no concern.
  Eigen::VectorXd tolerance;
  std::shared_ptr<const PhysicsFeatures> physics;  ///< for the semi-parametric kernel, or null
  Skeleton skeleton;
};

/// Throws bad_request for what contradicts itself.
void check_problem(const PolicyProblem& problem);

/// How far a position is from its target, as the cost measures it (>= 0). No term: 0.
[[nodiscard]] double position_error(const SaturatingCost& cost, Eigen::Index position,
                                    double value);

/// By the true states where they are known, else by the smoothed ones. False where no position has
/// a tolerance.
[[nodiscard]] bool succeeded(const PolicyProblem& problem, const Trial& trial);

}  // namespace kinescope::policy
