// SPDX-License-Identifier: Apache-2.0
//
// What a joint's torque is made of, term by term; each is linear in its parameter.
#pragma once

#include <string>
#include <vector>

#include "dynamics/rigid/base_parameters.h"
#include "dynamics/rigid/rigid_model.h"

namespace kinescope {

/// Terms of the drives beside the rigid bodies. Friction and motor inertia act on the joint's side.
struct DriveTerms {
  bool motor_inertia = true;  ///< times ddq
  bool viscous = true;        ///< times dq
  bool coulomb = true;        ///< times tanh(dq / width)
  bool offset = true;         ///< a constant torque (a sensor's zero, asymmetric Coulomb friction)
  bool asymmetric_viscous = false;    ///< times |dq|
  double coulomb_width_rad_s = 0.01;  ///< of revolute joints; 0 is the sign itself
  double coulomb_width_m_s = 0.002;   ///< of prismatic joints
  /// More motors that turn by a combination of joints, one weight a joint: (0, 0, 0, 0, 1, 1) for a
  /// wrist whose last motor also sees joint 5. Inertia, viscous and Coulomb friction of each act on
  /// all of its joints.
  std::vector<Eigen::VectorXd> coupled_drives;
};

/// The same with widths of Coulomb friction that a joint of the slowest kind leaves: at most a
/// tenth of the speed that it exceeds a tenth of the time. `types`: one a joint; `dq`: samples x
/// joints. Joints that hold still do not count.
[[nodiscard]] DriveTerms slow_enough(DriveTerms drives, const std::vector<JointType>& types,
                                     const Eigen::MatrixXd& dq);

enum class TermKind {
  kInertial,
  kMotorInertia,
  kViscous,
  kCoulomb,
  kAsymmetricViscous,
  kOffset,
  kCoupledInertia,
  kCoupledViscous,
  kCoupledCoulomb
};

struct TorqueTerm {
  TermKind kind = TermKind::kInertial;
  int index = 0;     ///< column of the rigid regressor, joint, or coupled drive
  std::string name;  ///< "Izz(link2)", "viscous(joint2)"
};

/// All terms: the bodies' ten parameters each, then the drives'. Throws bad_request for a width
/// below 0 or a coupled drive without one weight a joint.
[[nodiscard]] std::vector<TorqueTerm> torque_terms(const RigidModel& model,
                                                   const DriveTerms& drives);

/// The columns of the given terms: one matrix a joint, samples x terms; torque of joint j at sample
/// t is row t of matrix j times the parameters.
[[nodiscard]] std::vector<Eigen::MatrixXd> term_columns(
    const RigidModel& model, const DriveTerms& drives, const std::vector<TorqueTerm>& terms,
    const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq);

/// Independent terms of the robot, whatever the log: from random motions. Drives come last, so what
/// they share with the links (the motor of a first, vertical axis) is named after the links.
[[nodiscard]] ColumnBasis independent_terms(const RigidModel& model, const DriveTerms& drives,
                                            const std::vector<TorqueTerm>& terms);

}  // namespace kinescope
