// SPDX-License-Identifier: Apache-2.0
//
// What a fit leaves behind, for each route; internal. Everything in normalised units, sample-major.
#pragma once

#include <functional>
#include <vector>

#include "dynamics/gp/feature_system.h"
#include "dynamics/gp/gram.h"
#include "dynamics/gp/problem.h"

namespace kinescope::gp {

/// One row a sample from sample-major values.
[[nodiscard]] inline Eigen::MatrixXd by_sample(const Eigen::VectorXd& sample_major,
                                               Eigen::Index outputs) {
  return Eigen::Map<const Eigen::MatrixXd>(sample_major.data(), outputs,
                                           sample_major.size() / outputs)
      .transpose();
}

struct Moments {
  Eigen::VectorXd mean;
  Eigen::VectorXd variance;  ///< empty where not asked for
};

/// Workspace of one-sample prediction.
struct OneSample {
  Scratch scratch;
  Prepared prepared;
  Eigen::MatrixXd input;  ///< 1 x columns
  Eigen::MatrixXd cross;  ///< rows x outputs
  Eigen::MatrixXd prior;  ///< outputs x outputs
  Eigen::VectorXd mean;
  Eigen::VectorXd variance;
};

/// Posterior::mean_of_one() by the weights of the training samples; leaves k(training, input) in
/// `work.cross`.
void mean_of_one(const Covariance& covariance, const Prepared& training,
                 const Eigen::VectorXd& weights, OneSample& work);

/// Predictions for the targets that a fold leaves out.
struct LeftOut {
  Eigen::VectorXd mean;
  Eigen::VectorXd variance;  ///< noise included
  double log_density = 0.0;  ///< sum over the folds, joint within a fold
};

class Posterior {
 public:
  Posterior() = default;
  virtual ~Posterior() = default;
  Posterior(const Posterior&) = delete;
  Posterior& operator=(const Posterior&) = delete;

  [[nodiscard]] virtual Moments predict(Workers& workers, const Inputs& inputs,
                                        bool variance) const = 0;
  virtual void mean_of_one(OneSample& work) const = 0;
  virtual void variance_of_one(OneSample& work) const = 0;
  /// `folds`: for each fold its samples.
  [[nodiscard]] virtual LeftOut leave_out(
      Workers& workers, const std::vector<std::vector<Eigen::Index>>& folds) const = 0;
  /// w with mean = sum_i w_i k(x, x_i), over the training samples or the inducing inputs.
  [[nodiscard]] virtual Eigen::VectorXd kernel_weights() const = 0;
  /// y - E[f | y] and var[f | y] at the training samples.
  [[nodiscard]] virtual Moments at_training(Workers& workers) const = 0;
};

struct Fit {
  std::shared_ptr<const Posterior> posterior;
  double log_likelihood = 0.0;
  double jitter = 0.0;
  Eigen::Index features = 0;
};

/// One try at a Cholesky factor: what was added to the diagonal, and the 1-based row whose pivot is
/// not positive; 0 where there is none.
struct Attempt {
  double jitter = 0.0;
  Eigen::Index failed = 0;
};

/// Calls attempt(jitter relative to the mean diagonal) from 0 and then tenfold from the rounding of
/// the diagonal until there is a factor; gives the jitter that it took. Throws undetermined beyond
/// `max_jitter`.
double with_jitter(const Covariance& covariance, Eigen::Index samples, double max_jitter,
                   const std::function<Attempt(double)>& attempt);

[[nodiscard]] Fit fit_dense(Workers& workers, const Kernel& kernel,
                            const Eigen::VectorXd& log_noise, Problem problem,
                            const FitOptions& options);
/// The same over the processes of the present ProcessGroup (process_group.h).
[[nodiscard]] Fit fit_distributed(Workers& workers, const Kernel& kernel,
                                  const Eigen::VectorXd& log_noise, Problem problem,
                                  const FitOptions& options);
[[nodiscard]] Fit fit_features(Workers& workers, const Kernel& kernel,
                               const Eigen::VectorXd& log_noise, Problem problem);

}  // namespace kinescope::gp
