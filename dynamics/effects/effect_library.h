// SPDX-License-Identifier: Apache-2.0
//
// The effects that a model of rigid bodies lacks, as candidates for calib/trace: what each one adds
// to the torque that the actuators must give (friction, springs, a payload) or to what their
// sensors say (offset, gain, delay, lag), per unit of its parameters.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "calib/trace/traced_model.h"
#include "dynamics/effects/effect_motion.h"
#include "dynamics/rigid/rigid_model.h"
#include "kinematics/core/memo.h"

namespace kinescope {

/// Speeds within which Coulomb friction turns round, as in dynamics/identify; that of a joint is
/// searched for with its Coulomb friction.
struct FrictionWidths {
  double rad_s = 0.01;
  double m_s = 0.002;
};

/// How a joint moved in the log from which effects are found; scales of some effects.
struct JointTravel {
  double range = 0.0;
  double rms_speed = 0.0;
  double high_speed = 0.0;  ///< at 95 %
};

/// The log from which effects are found: what drifts is measured from its beginning to its end.
struct LogSpan {
  double begin_s = 0.0;
  double duration_s = 1.0;
  double lowest_c = 0.0;  ///< temperature
  double range_c = 1.0;
};

/// Columns that were asked for once. Shared by the candidates of all fits of one model.
using ColumnCache = Memo<std::string, Eigen::VectorXd>;

/// What effects are made from. Matrices are instants x joints, in the samples' unit of torque.
struct EffectContext {
  std::shared_ptr<const EffectMotion> motion;
  std::shared_ptr<ColumnCache> cache;  ///< of columns that depend on the motion only
  std::vector<std::string> joints;
  std::vector<char> turns;                    ///< revolute
  RigidModel rigid;                           ///< bodies, and gravity as it is believed to be
  Eigen::Matrix<double, 3, 2> gravity_moves;  ///< with the tilt of the base, m/s^2 a degree
  Eigen::MatrixXd load;                       ///< torque of the rigid bodies
  Eigen::MatrixXd torque;                     ///< torque of the model
  Eigen::MatrixXd measured_rate;              ///< d/dt of the measured torque
  Eigen::VectorXd temperature_c;              ///< instants; empty: not logged
  std::vector<JointTravel> travels;
  LogSpan log;
  Eigen::VectorXd widths;  ///< of each joint's sign of the speed, rad/s or m/s
  /// Least viscous and Coulomb friction and motor inertia that can be added to what the model
  /// declares: friction does not drive, and no rotor has less than no inertia. Empty: anything,
  /// where the model is one of differences.
  Eigen::VectorXd least_viscous, least_coulomb, least_motor_inertia;
  /// Of the Stribeck speeds that are looked for, the least of which the log shows more than half of
  /// the excess at some instant, through the low-pass; infinite: of none. A slower one is seen by
  /// its tail alone, and its size is an extrapolation (joints that move in turn gave three times
  /// the Coulomb friction where there is no excess; true ones are attained to 0.5 to 1). Empty: not
  /// asked for.
  Eigen::VectorXd least_stribeck_speed;
  std::string torque_unit = "Nm";  ///< "Nm" or "A"

  [[nodiscard]] std::string unit(std::size_t joint) const;  ///< of the joint's torque
  [[nodiscard]] std::string angle(std::size_t joint) const { return turns[joint] ? "rad" : "m"; }
  [[nodiscard]] Eigen::Index instants() const { return motion->instants(); }
};

/// Travels and span of the context's own motion.
void describe_log(EffectContext& context);

/// Candidates and what they act through. Row i * joints + j of the carriers is joint j at instant
/// i; the first carriers are the joints themselves.
struct EffectLibrary {
  std::vector<Candidate> candidates;
  Eigen::SparseMatrix<double> carriers;  ///< rows x carriers, unit of torque a carrier's unit

  [[nodiscard]] const Candidate* find(const EffectId& id) const;
};

/// All effects of the library for one log. The context is copied into the candidates.
[[nodiscard]] std::vector<Candidate> make_candidates(const EffectContext& context);
/// Of the motion, the bodies and gravity only.
[[nodiscard]] Eigen::SparseMatrix<double> make_carriers(const EffectContext& context);

/// Torque of an effect at the instants, instants x joints.
[[nodiscard]] Eigen::MatrixXd effect_torque(const Eigen::SparseMatrix<double>& carriers,
                                            const Candidate& candidate, double scan,
                                            const Eigen::VectorXd& values, Eigen::Index joints);

/// Gravity turned by a rotation vector about two axes across it, degrees; always the same two.
[[nodiscard]] Eigen::Vector3d tilted(const Eigen::Vector3d& gravity,
                                     const Eigen::Vector2d& tilt_deg);
/// Its derivative where nothing is turned yet, m/s^2 a degree.
[[nodiscard]] Eigen::Matrix<double, 3, 2> tilt_moves(const Eigen::Vector3d& gravity);
/// The least turn that takes one gravity to the other: at most 180 degrees.
[[nodiscard]] Eigen::Vector2d tilt_between(const Eigen::Vector3d& gravity,
                                           const Eigen::Vector3d& other);

}  // namespace kinescope
