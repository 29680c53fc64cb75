// SPDX-License-Identifier: Apache-2.0
//
// Least squares over several joints that share parameters, each joint with its own noise, which is
// found with the parameters. By normal equations of columns scaled to length 1, which halves the
// digits: a condition of the columns up to 1e6 leaves four.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kinematics/core/dense_algebra.h"

namespace kinescope {

/// What residuals above the noise count. Scales are those of 95 % efficiency for normal noise, but
/// Student's.
enum class RobustLoss {
  kNone,
  kHuber,   ///< linear from 1.345 sigma
  kTukey,   ///< nothing from 4.685 sigma; starts from Huber's solution
  kStudent  ///< Student's t with 4 degrees of freedom, by expectation-maximisation
};

namespace identify {

/// What one joint's torque depends on: its columns only, which are a third of all in a chain.
struct JointColumns {
  std::vector<int> parameters;  ///< which parameter each column is for, increasing
  Eigen::MatrixXd W;            ///< samples x columns

  [[nodiscard]] Eigen::VectorXd times(const Eigen::VectorXd& all) const {
    return W * all(parameters);
  }
};

struct StackedSystem {
  std::vector<JointColumns> joints;
  Eigen::Index parameters = 0;
  Eigen::MatrixXd torque;   ///< samples x joints
  Eigen::MatrixXd weights;  ///< samples x joints, 0 and up; 0 leaves the sample out
};

/// The columns that are not zero.
[[nodiscard]] JointColumns compact_columns(const Eigen::MatrixXd& all);

/// Sum of weight W' W over rows [first, first + rows) of all joints.
[[nodiscard]] Eigen::MatrixXd gram(const StackedSystem& system, const Eigen::MatrixXd& weights,
                                   Eigen::Index first, Eigen::Index rows);
/// Sum of W' values over the same.
[[nodiscard]] Eigen::VectorXd gradient(const StackedSystem& system, const Eigen::MatrixXd& values,
                                       Eigen::Index first, Eigen::Index rows);

/// Solves H x = g with columns scaled to length 1 and `ridge` added to the scaled diagonal.
/// Factored once.
class ScaledSolver {
 public:
  ScaledSolver(const Eigen::MatrixXd& H, double ridge);
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& g) const;

 private:
  Eigen::VectorXd inverse_length_;
  LdltFactor factor_;
};

struct WeightedFitOptions {
  RobustLoss loss = RobustLoss::kNone;
  double ridge = 1e-10;   ///< draws to the prior where the data say nothing
  Eigen::VectorXd prior;  ///< empty: zero
  int max_iterations = 50;
};

struct WeightedFit {
  Eigen::VectorXd parameters;
  Eigen::VectorXd sigma;          ///< noise of each joint at weight 1
  Eigen::MatrixXd final_weights;  ///< samples x joints: weight x robust weight / sigma^2
  Eigen::MatrixXd curvature;  ///< the same with the loss's second derivative for the robust weight
  Eigen::MatrixXd robust_weights;  ///< samples x joints, 0 to 1
  Eigen::MatrixXd residuals;       ///< torque - W parameters
  int iterations = 0;
  bool converged = false;
};

/// Iteratively reweighted least squares. Gautier 1997 (each joint's noise); Huber 1981 (robust
/// part).
[[nodiscard]] WeightedFit weighted_fit(const StackedSystem& system,
                                       const WeightedFitOptions& options);

}  // namespace identify
}  // namespace kinescope
