// SPDX-License-Identifier: Apache-2.0
//
// Friction of drives that slide and stick, from a log: sliding friction of a joint and the interval
// that sticking may take. Armstrong-Helouvry, Dupont, Canudas de Wit 1994.
#pragma once

#include <vector>

#include "dynamics/contact/balance.h"
#include "dynamics/contact/sliding.h"

namespace kinescope {

/// Torques in the unit of the log, N m, N or A. Sliding with direction s = +-1 takes
///     offset + viscous dq + s (coulomb + stribeck exp(-(dq / stribeck_speed)^2)),
/// or, where friction turns round smoothly, coulomb tanh(|dq| / rise_speed) in place of coulomb.
struct SlidingFriction {
  double offset = 0.0;
  double viscous = 0.0;
  double coulomb = 0.0;
  double stribeck = 0.0;
  double stribeck_speed = 0.0;  ///< rad/s or m/s
  double rise_speed = 0.0;      ///< rad/s or m/s; 0: at once
  double lowest = 0.0;          ///< sticking may take anything from here
  double highest = 0.0;         ///< to here
  /// rad/s or m/s; slower, and friction may rise up to breakaway for all that the log tells.
  double slowest_known = 0.0;
  double fastest_known = 0.0;   ///< faster, viscous friction may be none or twice as much
  double sigma = 0.0;           ///< robust spread of what sliding leaves unexplained
  double slid_s = 0.0;          ///< time that the joint slid
  double presliding = 0.0;      ///< rad or m from a rest or turn until it slides; 0: usual
  bool slides_forward = false;  ///< the log showed it; else it is an interval there too
  bool slides_backward = false;

  [[nodiscard]] bool known() const { return slides_forward || slides_backward; }
  [[nodiscard]] bool known(int direction) const {
    return direction > 0 ? slides_forward : direction < 0 && slides_backward;
  }
  [[nodiscard]] double sliding(double dq, int direction) const;
};

/// Slope of each column over some 50 ms about each sample, samples x columns, per s.
[[nodiscard]] Eigen::MatrixXd windowed_rates(const Eigen::VectorXd& t_s,
                                             const Eigen::MatrixXd& values);

/// What masses leave of the measured torque, samples x joints: offset, friction, contacts and the
/// model's error. `motion`: one uninterrupted motion.
[[nodiscard]] Eigen::MatrixXd drive_residual(const RigidModel& model, const TorqueSamples& motion);

/// Friction of each joint by a robust fit (Huber) to the samples in which it slides. A joint that
/// hardly slides is not known(): its torque says nothing of contacts. How far a joint has to move
/// until it slides is what most of its turns show, SlidingOptions' ways at the least.
[[nodiscard]] std::vector<SlidingFriction> sliding_friction(
    const RigidModel& model, const std::vector<TorqueSamples>& motions);

/// The same from what some other model leaves of the torque, samples x joints of each motion.
[[nodiscard]] std::vector<SlidingFriction> sliding_friction(
    const RigidModel& model, const std::vector<TorqueSamples>& motions,
    const std::vector<Eigen::MatrixXd>& residuals);

/// Of a model with so many parameters beside friction, on the samples that friction was fitted to:
/// deviance with a penalty for parameters (Schwarz 1978), stretches of 0.25 s being independent.
[[nodiscard]] double sliding_deviance(const std::vector<SlidingFriction>& friction, int parameters);

/// The balance of one uninterrupted motion. Where a joint may stick, its friction is what keeps the
/// balance, within its interval: only what leaves the interval is in `drive`. So it is where a
/// joint without any inertia in the model speeds up the way its torque pushes it. `sigma`: samples
/// x joints, for BalanceSample::sigma; empty: 1.
[[nodiscard]] std::vector<BalanceSample> sliding_balance(
    const RigidModel& model, const std::vector<SlidingFriction>& friction,
    const TorqueSamples& motion, const Eigen::MatrixXd& sigma = {});

/// What a torque model says of one uninterrupted motion, friction included: samples x joints.
struct PredictedTorque {
  Eigen::MatrixXd mean;
  /// Without the friction of the joint's own drive, as far as the model tells it.
  Eigen::MatrixXd frictionless;
  Eigen::MatrixXd sigma;  ///< predictive standard deviation
  /// d mean / d acceleration, joints x joints, one a sample. The accelerations behind `mean` are a
  /// low-pass's; what they lack shows in the measured speed beyond `speed`, which they lead to, and
  /// inertia times that is a momentum. Both empty: the accelerations are exact.
  std::vector<Eigen::MatrixXd> inertia = {};
  Eigen::MatrixXd speed = {};
};

/// Friction of a joint beside a torque model.
struct PredictedFriction {
  SlidingFriction whole;       ///< of what `frictionless` leaves; sigma: of what the model leaves
  SlidingFriction correction;  ///< of what the model leaves: friction drifts with temperature
  /// Slid one way only: no model tells its friction from other torque, and all of it may be some.
  bool may_be_all = false;
};

[[nodiscard]] std::vector<PredictedFriction> predicted_friction(
    const RigidModel& model, const std::vector<TorqueSamples>& motions,
    const std::vector<PredictedTorque>& predicted);

/// One a joint: 0 where PredictedTorque::inertia is significantly worse than none in the motions,
/// and does not significantly explain the torque at the low-pass's accelerations either. A model of
/// a hardly accelerated joint has some that is noise, and would carry the noise of speeds into the
/// balance. Noise of speeds alone says nothing against an inertia that the motion shows: the
/// detector knows that noise, and not what the low-pass takes at the ends of a log and where
/// accelerations change fast.
[[nodiscard]] std::vector<char> usable_inertia(const RigidModel& model,
                                               const std::vector<TorqueSamples>& motions,
                                               const std::vector<PredictedTorque>& predicted);
[[nodiscard]] PredictedTorque with_inertia_of(PredictedTorque predicted,
                                              const std::vector<char>& joints);

/// The balance of a predicted torque: `drive` is what was measured beyond it, and beyond the
/// interval that friction may take where a joint may stick. BalanceSample::sigma is the model's
/// own, in units of PredictedFriction::whole.sigma.
[[nodiscard]] std::vector<BalanceSample> predicted_balance(
    const RigidModel& model, const std::vector<PredictedFriction>& friction,
    const TorqueSamples& motion, const PredictedTorque& predicted);

}  // namespace kinescope
