// SPDX-License-Identifier: Apache-2.0
//
// A model with the effects that tracing found, one sample after another: friction with a memory
// follows the motion, so that a controller has what predict_torque() has of a log.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "dynamics/rigid/newton_euler.h"
#include "dynamics/simulation/plant.h"

namespace kinescope {

/// The motion that a torque is asked for; one entry a joint.
struct MotionPoint {
  double t_s = 0.0;
  Eigen::VectorXd q, dq, ddq;
};

/// True torques of the actuators; what sensors add (gain, cross-talk, delay) is no matter of a
/// command.
class OnlineTorque {
 public:
  explicit OnlineTorque(Plant plant);

  /// M ddq + C dq + g + drives. Pre-sliding (Dahl) moves on to this posture; at the first one it is
  /// as after a long way in the direction of the speed.
  const Eigen::VectorXd& at(const MotionPoint& motion);
  /// What holds the robot there: no friction.
  const Eigen::VectorXd& at_rest(const Eigen::VectorXd& q, double t_s);
  [[nodiscard]] Eigen::Index size() const { return plant_.size(); }

 private:
  void move_presliding(const MotionPoint& motion);
  void add_coupled(const MotionPoint& motion);

  Plant plant_;
  rigid::NewtonEuler bodies_, load_bodies_;
  bool begun_ = false;
  Eigen::VectorXd last_q_, zero_, load_, torque_;
  std::vector<std::vector<double>> presliding_;
};

}  // namespace kinescope
