// SPDX-License-Identifier: Apache-2.0
//
// The last thing before the motors: limits of torque and of its rate, and never a number that is
// none.
#pragma once

#include <Eigen/Core>

namespace kinescope {

struct TorqueLimits {
  Eigen::VectorXd largest = {};     ///< N m or N, one a joint, >= 0; empty: none
  Eigen::VectorXd rate_per_s = {};  ///< N m/s or N/s, one a joint, > 0; empty: none
};

class TorqueLimiter {
 public:
  /// Begins at no torque; the first command is not limited in its rate, or a robot that has held
  /// itself would fall first.
  TorqueLimiter(TorqueLimits limits, Eigen::Index joints, double period_s);

  /// A torque that is NaN or infinite is replaced by the joint's last one.
  const Eigen::VectorXd& apply(const Eigen::VectorXd& wanted);

  [[nodiscard]] const Eigen::VectorXi& limited() const { return limited_; }    ///< times, by joint
  [[nodiscard]] const Eigen::VectorXi& replaced() const { return replaced_; }  ///< times, by joint

 private:
  TorqueLimits limits_;
  double period_s_;
  bool begun_ = false;
  Eigen::VectorXd sent_;
  Eigen::VectorXi limited_, replaced_;
};

}  // namespace kinescope
