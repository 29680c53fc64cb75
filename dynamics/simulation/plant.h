// SPDX-License-Identifier: Apache-2.0
//
// Takes   a DynamicModel, or a CorrectedTorqueModel of dynamics/effects: bodies and effects.
// Gives   Plant: the robot as a simulator moves it, by the laws that tracing knows
//         (dynamics/effects/drive_laws.h).
// Units   SI; vectors hold one entry a moving joint, in the tree's order. Torques in N m or N.
// Method  torque = M(q) ddq + C(q, dq) dq + g(q) + drives; measured = gain * torque, low-passed and
// delayed. Not here: integration (simulation.h), servo (servo.h), contacts, temperature.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "dynamics/effects/drive_laws.h"
#include "dynamics/effects/trace_torque.h"
#include "dynamics/rigid/rigid_model.h"

namespace kinescope {

/// What one joint's drive adds to the rigid bodies, beside inertia and viscous friction (Plant).
struct JointDrive {
  struct Wave {
    double number = 0.0;  ///< rad a rad or m
    double sine = 0.0, cosine = 0.0;
  };
  struct Power {
    double at_high_speed = 0.0, high_speed = 1.0, power = 3.0;
  };
  struct Stribeck {
    double excess_at_rest = 0.0, speed = 1.0;
  };
  struct Drift {
    effects::Settling settling;
    double offset = 0.0, coulomb = 0.0, viscous = 0.0;
  };
  struct Presliding {
    double friction = 0.0, length = 1.0;
  };

  double width = 0.0;  ///< speed within which dry friction changes its direction; 0: it sticks
  double offset = 0.0;
  double stiffness = 0.0;   ///< about 0; the rest position is in `offset`
  double asymmetric = 0.0;  ///< times |dq|
  std::vector<Power> powers = {};
  std::vector<Wave> ripples = {};
  std::vector<Drift> drifts = {};

  double coulomb = 0.0;
  double share_of_load = 0.0;  ///< of |torque of the bodies|
  std::vector<Stribeck> stribecks = {};
  std::vector<Wave> position_friction = {};
  std::vector<Presliding> presliding = {};  ///< Dahl
};

/// Dry friction of a drive that turns with the sum or the difference of two joints.
struct CoupledDrive {
  Eigen::VectorXd weights;
  double coulomb = 0.0;
  double width = effects::kCoupledWidth_rad_s;
};

struct Plant {
  RigidModel rigid;                   ///< with payloads and motor inertias
  RigidModel unloaded;                ///< without payloads: what load friction is a share of
  Eigen::MatrixXd coupled_inertia;    ///< of coupled drives, added to the mass matrix
  Eigen::MatrixXd viscous;            ///< joints x joints, symmetric
  std::vector<JointDrive> drives;     ///< one a joint
  std::vector<CoupledDrive> coupled;  ///< with dry friction
  Eigen::MatrixXd gain;               ///< measured torques from true ones
  Eigen::VectorXd delay_s;            ///< by which each torque is measured late
  Eigen::VectorXd lag_s;              ///< time constant of the low-pass before that; 0: none
  std::vector<std::string> left_out;  ///< effects that are not simulated, in words

  [[nodiscard]] Eigen::Index size() const { return rigid.size(); }
};

/// Throws bad_input for an effect that is none of this robot's, or has other parameters than the
/// library's.
[[nodiscard]] Plant make_plant(const CorrectedTorqueModel& model);

/// The model's bodies, friction and motor inertia, with effects on top. `travels` give the speeds
/// that some effects are relative to, `log` when drifts begin and end. Friction sticks.
[[nodiscard]] CorrectedTorqueModel with_effects(const DynamicModel& model,
                                                std::vector<TorqueEffect> effects = {},
                                                std::vector<JointTravel> travels = {},
                                                const LogSpan& log = {});

/// The same robot, with friction that holds a joint at rest up to breakaway (Coulomb's set-valued
/// law) in place of one that is smooth within a width of speeds.
[[nodiscard]] Plant sticking(Plant plant);

}  // namespace kinescope
