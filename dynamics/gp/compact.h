// SPDX-License-Identifier: Apache-2.0
//
// Takes   processes of one output as numbers: kernel, points, weights, a triangle for the variance.
// Gives   mean and variance of one sample in a few microseconds; the same bits on any processor.
// Units   of inputs and targets as they are: nothing is normalised.
// Method  mean: weights of kernel values at the points (Rasmussen and Williams 2006, eq. 2.27);
//         variance: k(x, x) - |R k|^2 from inducing points (Titsias 2009), averaged over processes
//         of parts of the samples.
// Not here: fitting (gaussian_process.h, sparse.h); features that need a robot (dynamics/models).
#pragma once

#include <vector>

#include "dynamics/gp/gaussian_process.h"
#include "dynamics/gp/robot_kernels.h"

namespace kinescope::gp {

/// A covariance function as numbers: the sum of the parts that are there, in squared units of the
/// target. Of a motion (q, dq, ddq of all joints) and of features of it that the caller makes.
struct CompactKernel {
  double rbf_variance = 0.0;
  Eigen::VectorXd rbf_rates;   ///< 1 / length scale, one a column of the motion; empty: no RBF
  JointKinds gip_joints;       ///< of gip(); empty: none
  double gip_offset = 0.0;     ///< of its motion factor
  Eigen::VectorXd gip_motion;  ///< weights of accelerations_and_velocity_products()
  Eigen::VectorXd gip_first;   ///< weights of (cos, sin) or q, joint after joint
  Eigen::VectorXd gip_second;  ///< of each joint's second factor
  Eigen::VectorXd linear;      ///< weights of the features; empty: none
};

/// Rows of tables of motions and features that are kept elsewhere, once for all joints.
struct CompactGp {
  CompactKernel kernel;
  double shift = 0.0;       ///< of the mean
  std::vector<int> points;  ///< rows; those that carry the variance come first
  Eigen::VectorXd weights;  ///< one a point
  Eigen::MatrixXd root;     ///< R, upper triangle; its size is the number of the former
};

/// The variance of processes that have seen a part of the samples each, normalised.
struct CompactVariance {
  Eigen::MatrixXd root;              ///< R: k(x, x) - |R k(points, x)|^2 is their mean
  std::vector<Eigen::VectorXd> own;  ///< of each part's process at its own inputs
};
/// Through inducing inputs (dynamics/gp/sparse.h). `inputs`: one a part, or none at all.
[[nodiscard]] CompactVariance compact_variance(const GpModel& model,
                                               const std::vector<Dataset>& parts,
                                               const std::vector<Eigen::MatrixXd>& inputs,
                                               const Eigen::MatrixXd& inducing,
                                               const FitOptions& options = {});

/// One sample after another, of the processes of all joints: no allocation after the first. One for
/// each thread. Processes of the same points and parts are computed together.
class CompactPredictor {
 public:
  /// `motions`: rows x columns of the motion; `features`: one table a process, rows x features.
  /// Throws bad_request for parts that do not fit each other.
  CompactPredictor(const std::vector<CompactGp>& processes, const Eigen::MatrixXd& motions,
                   const std::vector<Eigen::MatrixXd>& features);
  ~CompactPredictor();
  CompactPredictor(CompactPredictor&&) noexcept;
  CompactPredictor& operator=(CompactPredictor&&) noexcept;

  /// One entry a process, as `features`.
  const Eigen::VectorXd& mean(const Eigen::VectorXd& motion,
                              const std::vector<Eigen::VectorXd>& features);
  /// Of the function, at the sample of the last `mean`; infinite where it overflows.
  [[nodiscard]] double variance(Eigen::Index process);

 private:
  struct Process;
  struct Group;

  std::vector<Process> processes_;
  std::vector<Group> groups_;
  Eigen::VectorXd mean_;
};

}  // namespace kinescope::gp
