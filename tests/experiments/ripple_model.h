// SPDX-License-Identifier: Apache-2.0
//
// Current of one joint in slow motion: friction that depends on speed, ripple that is periodic in
// position. Periods are found in the data.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace kinescope {

/// One run; speeds are causal slopes over a trailing window.
struct JointRun {
  Eigen::VectorXd t_s, q, current, speed;
  Eigen::VectorXd
      quiet_speed;        ///< 1 where it has not been speeding up or turning round lately, else 0
  Eigen::Index free = 0;  ///< samples at the beginning that are surely without contact
};

struct RippleModel {
  std::vector<double> frequencies;  ///< cycles per unit of position
  Eigen::VectorXd weights;
  Eigen::MatrixXd covariance;  ///< of the weights
  double steady_sigma = 0.0;   ///< rms of what is left in steady motion, A
  double unsteady_sigma = 0.0;

  [[nodiscard]] Eigen::VectorXd predict(const JointRun& run) const;
  [[nodiscard]] Eigen::VectorXd sigma(const JointRun& run) const;
};

/// Slope of q over the trailing `window_s`, and where it has not grown by a third within
/// `settle_s`.
void add_speeds(JointRun& run, double window_s, double settle_s);

/// From the free parts of the runs.
[[nodiscard]] std::vector<double> find_frequencies(const std::vector<const JointRun*>& runs);
[[nodiscard]] RippleModel learn_ripple(const std::vector<const JointRun*>& runs,
                                       const std::vector<double>& frequencies);

}  // namespace kinescope
