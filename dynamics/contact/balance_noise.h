// SPDX-License-Identifier: Apache-2.0
//
// What disturbs the balance of momentum when nothing touches the robot, one number a joint each:
// white noise of the velocity, white noise of the torque, and the model's own error, which is
// coloured. Estimated from a log, robustly: contacts may be in it.
#pragma once

#include <vector>

#include "dynamics/contact/balance.h"

namespace kinescope {

/// The model's error is an Ornstein-Uhlenbeck process with standard deviation model_sigma times the
/// sample's own sigma.
struct BalanceNoise {
  Eigen::VectorXd velocity_sigma;  ///< rad/s or m/s a sample; 0 without a rigid-body model
  Eigen::VectorXd torque_sigma;    ///< a sample
  Eigen::VectorXd model_sigma;     ///< times BalanceSample::sigma, torque
  Eigen::VectorXd model_time_s;    ///< correlation time of the model's error
};

/// White parts from third differences (motion leaves next to nothing in them), the model's error
/// from how the accumulated imbalance grows with the length of a window. Each spread is that of the
/// smaller 95 % of the values or, of samples that nothing was left out of yet, of their half: a
/// contact of a few seconds must not count as the model's error. Where a joint may stick it tells
/// nothing; one that hardly slides gets a torque_sigma beside which nothing counts. `use`: one a
/// sample, 0 leaves the sample out; empty uses all. Throws undetermined for fewer than 200 usable
/// samples, and a torque that is constant.
[[nodiscard]] BalanceNoise estimate_noise(const std::vector<BalanceSample>& samples,
                                          const std::vector<char>& use = {});

/// Of a log to learn from and, from sample `second` on, the log that is looked at: joint by joint
/// the larger one. A model errs more on motion that it was not fitted to, and how much more only
/// that motion tells. A second log of too few usable samples adds nothing.
[[nodiscard]] BalanceNoise estimate_noise_of_both(const std::vector<BalanceSample>& samples,
                                                  const std::vector<char>& use, std::size_t second);

/// After a gap longer than so many usual steps, detectors begin anew.
inline constexpr double kGapSteps = 10.0;

/// The usual step between samples, s. Throws undetermined for fewer than two.
[[nodiscard]] double median_step_s(const std::vector<BalanceSample>& samples);

}  // namespace kinescope
