// SPDX-License-Identifier: Apache-2.0
//
// Joint velocities as a robot with encoders knows them: backward differences through a first-order
// low-pass, which lags by 1 / (2 pi cut-off) and half a period.
#pragma once

#include <Eigen/Core>

namespace kinescope {

class VelocityEstimator {
 public:
  /// Starts at this posture and rate (rad or m, per s). `cutoff_hz`: -3 dB.
  VelocityEstimator(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, double rate_hz,
                    double cutoff_hz);

  /// From the reading of one period later.
  const Eigen::VectorXd& update(const Eigen::VectorXd& q);

 private:
  Eigen::VectorXd last_q_, dq_;
  double rate_hz_;
  double share_;  ///< of the newest difference
};

}  // namespace kinescope
