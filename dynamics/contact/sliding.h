// SPDX-License-Identifier: Apache-2.0
//
// When a drive slides and when it may stick: where a joint rests, starts or turns round, friction
// is whatever keeps the balance, up to breakaway; after that it has its sliding value.
#pragma once

#include "dynamics/data/torque_samples.h"
#include "dynamics/rigid/rigid_model.h"

namespace kinescope {

enum class Slide : int { kBackward = -1, kMayStick = 0, kForward = 1 };

struct SlidingOptions {
  /// Motion over this time tells rest from motion; reversals and stops are noticed that early.
  double window_s = 0.05;
  /// Slower is rest; and so is what the noise of the positions could be. An eighth of the slowest
  /// sweep that was measured (UR5, 1 deg/s).
  double rest_speed_rad_s = 0.002;
  double rest_speed_m_s = 0.0004;
  /// Travel after rest or reversal until friction slides: six times the presliding of a UR5's base,
  /// which is done after 5e-4 rad (build/test/contact logs_ur5).
  double presliding_rad = 3e-3;
  double presliding_m = 6e-4;
  Eigen::VectorXd presliding = {};  ///< of each joint, rad or m; empty or 0: those
};

/// Way of each joint since it rested or turned round, beyond what noise of its positions could be,
/// below zero where it moves backward; zero where it rests or turns. Positions alone are looked at.
/// Samples x joints of one uninterrupted motion, rad or m.
[[nodiscard]] Eigen::MatrixXd ways_since_turns(const RigidModel& model, const Eigen::VectorXd& t_s,
                                               const Eigen::MatrixXd& q,
                                               const SlidingOptions& options = {});

/// The way after which a joint slides, rad or m.
[[nodiscard]] double presliding_of(const RigidModel& model, Eigen::Index joint,
                                   const SlidingOptions& options = {});

/// One entry a sample and joint of one uninterrupted motion, the values of Slide; positions alone
/// are looked at. Samples x joints.
[[nodiscard]] Eigen::MatrixXi sliding_states(const RigidModel& model, const Eigen::VectorXd& t_s,
                                             const Eigen::MatrixXd& q,
                                             const SlidingOptions& options = {});

/// The same of samples in several motions (TorqueSamples::trajectory).
[[nodiscard]] Eigen::MatrixXi sliding_states(const RigidModel& model, const TorqueSamples& samples,
                                             const SlidingOptions& options = {});

/// Samples where the joint slides forward, and backward.
struct SlidCount {
  Eigen::Index forward = 0;
  Eigen::Index backward = 0;
};
[[nodiscard]] SlidCount slid(const Eigen::MatrixXi& states, Eigen::Index joint);

}  // namespace kinescope
