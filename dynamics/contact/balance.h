// SPDX-License-Identifier: Apache-2.0
//
// One sample of the balance of momentum, dp/dt = drive + external torque: everything that contact
// detection sees of a robot. With a rigid-body model p = M(q) dq; where only a predicted torque
// exists, p = 0 and the drive is what the prediction does not explain.
#pragma once

#include <limits>
#include <vector>

#include <Eigen/Core>

#include "dynamics/data/torque_samples.h"
#include "dynamics/rigid/momentum.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

/// Vectors have one entry a joint. Torques in the unit of the log (N m, N or A), momentum times s.
struct BalanceSample {
  double stamp_s = 0.0;
  Eigen::VectorXd momentum;  ///< zero without a rigid-body model
  Eigen::VectorXd drive;     ///< what changes momentum but for a contact
  Eigen::VectorXd velocity;  ///< measured; empty without a rigid-body model
  Eigen::MatrixXd mass;      ///< d momentum / d velocity: noise of the velocity; empty without one
  /// Standard deviation of the model's torque as predicted by the model itself, without the
  /// sensor's noise. Only its ratios count: the scale of each joint is calibrated.
  Eigen::VectorXd sigma;
  /// 1 where the joint may stick (sliding.h): `drive` is then what friction cannot take, and says
  /// nothing of noise. Empty: no joint does.
  Eigen::VectorXi sticks = {};

  [[nodiscard]] bool may_stick(Eigen::Index joint) const {
    return sticks.size() > 0 && sticks[joint] != 0;
  }
};

/// Friction and offset of a drive, as part of its measured torque:
/// viscous dq + coulomb tanh(dq / width) + offset.
struct DriveFriction {
  double viscous = 0.0;
  double coulomb = 0.0;
  double offset = 0.0;
  double coulomb_width = 0.01;  ///< rad/s or m/s
  /// Doubt of the friction about its reversal, as a share of `coulomb`: adds to sigma^2 the square
  /// of coulomb * reversal_doubt / sigma_unit within a few widths of standstill.
  double reversal_doubt = 0.0;
  double sigma_unit = 1.0;  ///< torque that counts as sigma = 1
};

/// Viscous and Coulomb friction of the movable joints as the model has them.
[[nodiscard]] std::vector<DriveFriction> friction_of(const DynamicModel& model);

/// Samples of a rigid-body model with friction. evaluate() does not allocate.
class RigidBalance {
 public:
  /// `friction`: one a movable joint, or empty for none. Throws bad_request for another number.
  explicit RigidBalance(RigidModel model, std::vector<DriveFriction> friction = {});

  /// torque: what the actuators apply, N m or N. The reference is good until the next call.
  const BalanceSample& evaluate(double stamp_s, const Eigen::Ref<const Eigen::VectorXd>& q,
                                const Eigen::Ref<const Eigen::VectorXd>& dq,
                                const Eigen::Ref<const Eigen::VectorXd>& torque);

 private:
  MomentumRecursion recursion_;
  std::vector<DriveFriction> friction_;
  BalanceSample sample_;
};

/// A whole log: accelerations are not looked at, velocities and torques should not be smoothed over
/// more than a few samples.
[[nodiscard]] std::vector<BalanceSample> balance_samples(RigidBalance balance,
                                                         const TorqueSamples& samples);

/// Of a torque that some model predicts, samples x joints; `sigma` its predictive standard
/// deviation without the sensor's noise, or empty where there is none.
[[nodiscard]] std::vector<BalanceSample> balance_samples(const Eigen::VectorXd& t_s,
                                                         const Eigen::MatrixXd& measured,
                                                         const Eigen::MatrixXd& predicted,
                                                         const Eigen::MatrixXd& sigma = {});

/// Nothing in it is NaN or infinite.
[[nodiscard]] bool is_finite(const BalanceSample& sample);

}  // namespace kinescope
