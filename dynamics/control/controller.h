// SPDX-License-Identifier: Apache-2.0
//
// Takes   a law with its gains, what is known of the robot, limits; the reference and what the
//         sensors say.
// Gives   Controller: one torque command a period, for a loop of its own or run_servo() (servo.h).
// Units   SI; vectors have one entry a moving joint, in the tree's order.
// Method  independent-joint PD, PD with gravity compensation, feed-forward of the model along the
//         reference, computed torque (Siciliano, Sciavicco, Villani, Oriolo 2009, sections 8.3 to
//         8.5). The model is nominal or learned (compensation.h).
// Not here: the plant, encoders, delay (servo.h), trajectories.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "dynamics/control/compensation.h"
#include "dynamics/control/torque_limiter.h"

namespace kinescope {

enum class ControlLaw {
  kPd,           ///< kp e + kd de
  kPdGravity,    ///< and what holds the robot where it is
  kFeedForward,  ///< and the model's torque along the reference
  /// The model's torque at the measured position and rate and the reference's acceleration, and
  /// M(q) (w^2 e + 2 w de) with the nominal masses: gains that suit every posture. Feedback through
  /// a separate M is more robust than through a learned torque's slope in the acceleration.
  kComputedTorque
};

/// "pd", "pd_gravity", "feed_forward", "computed_torque".
[[nodiscard]] std::string_view to_string(ControlLaw law);
/// Nothing for an unknown name.
[[nodiscard]] std::optional<ControlLaw> control_law(std::string_view name);
[[nodiscard]] const std::vector<ControlLaw>& all_control_laws();

/// Gains of every joint for a bandwidth w: kp = m w^2, kd = 2 m w, with 1 / m the joint's own entry
/// of the inverse mass matrix at a posture.
struct ServoGains {
  Eigen::VectorXd kp;  ///< N m/rad or N/m
  Eigen::VectorXd kd;  ///< N m s/rad or N s/m
};
/// `mass`: joints x joints, kg m^2.
[[nodiscard]] ServoGains servo_gains(const Eigen::MatrixXd& mass, double bandwidth_hz);

struct ControllerOptions {
  ControlLaw law = ControlLaw::kFeedForward;
  ServoGains gains;            ///< of all laws but computed torque
  double bandwidth_hz = 10.0;  ///< of computed torque
  double rate_hz = 1000.0;
  TorqueLimits limits = {};
};

/// What the sensors said, and the reference of that moment: both may be late.
struct Measured {
  Eigen::VectorXd q, dq;
  Eigen::VectorXd reference_q, reference_dq;
};

class Controller {
 public:
  /// Throws what Compensation throws.
  Controller(const KnownRobot& robot, const ControllerOptions& options);

  /// The command of one period. `reference` is finite; a joint's reading that is not is replaced by
  /// its last one, before the first by the reference. What is still not finite is never sent
  /// (torque_limiter.h).
  const Eigen::VectorXd& command(const MotionPoint& reference, const Measured& measured);

  /// Of the last command, before the limits; N m or N.
  [[nodiscard]] const Eigen::VectorXd& feedback() const { return feedback_; }
  [[nodiscard]] const Eigen::VectorXd& weight() const { return compensation_.weight(); }
  [[nodiscard]] const TorqueLimiter& limiter() const { return limiter_; }

 private:
  void take(const Measured& measured);
  const Eigen::VectorXd& model_torque(const MotionPoint& reference);
  void feed_back();

  ControllerOptions options_;
  RigidModel nominal_;
  Compensation compensation_;
  TorqueLimiter limiter_;
  Measured measured_;  ///< the last usable one
  MotionPoint asked_;  ///< of computed torque
  Eigen::VectorXd none_, proportional_, derivative_, feedback_, torque_;
};

}  // namespace kinescope
