// SPDX-License-Identifier: Apache-2.0
//
// Takes   a log of a robot that carries something, and what it would be without: a model whose
//         masses are trusted, or a second log without the load.
// Gives   PayloadEstimate: mass and centre of the load, with intervals, and what each joint says.
// Frames  the centre is in the frame of the body that carries the load (the child link of its
//         joint); SI units, torques in N m and N.
// Method  one body more, ten parameters, beside drives and base parameters that are free too
//         (Khalil, Gautier, Lemoine 2007), robust; block jackknife. payload_at_rest(): from the
//         part of the learned torque that is even in the velocity, at zero acceleration.
// Not here: which link carries something that nobody declared (dynamics/effects).
#pragma once

#include <string>
#include <vector>

#include "dynamics/identify/identify.h"
#include "dynamics/identify/robust_torque.h"
#include "kinematics/model/inertial_parameters.h"

namespace kinescope {

struct PayloadOptions {
  DriveTerms drives = {};  ///< free in every log: load and warmth change friction and offsets
  RobustLoss loss = RobustLoss::kHuber;
  std::string link;  ///< that carries it; empty: the last one, if there is one only
  double ridge = 1e-10;
  double block_correlations = 10.0;  ///< as IdentifyOptions
  int fewest_blocks = 20;
};

/// The mass that one joint's torque alone would say, the centre being that of all joints.
struct MassOfJoint {
  int joint = 0;
  double mass_kg = 0.0;
  double sigma_kg = 0.0;
};

struct PayloadEstimate {
  std::string link;  ///< name of the body's link
  double mass_kg = 0.0;
  double sigma_kg = 0.0;
  double lower_kg = 0.0;  ///< 95 %, Student's t with `freedom`
  double upper_kg = 0.0;
  int freedom = 0;
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d centre_sigma_m = Eigen::Vector3d::Zero();
  Vector10d parameters = Vector10d::Zero();  ///< InertialParameters::vector()
  std::vector<MassOfJoint> joints;           ///< those that say something
  /// What the sigmas were multiplied by because the joints disagree more than their noise lets them
  /// (Birge 1932): wrong drive gains, or wrong geometry. 1: they agree.
  double disagreement = 1.0;

  /// Its interval does not hold 0.
  [[nodiscard]] bool is_seen() const { return lower_kg > 0.0 || upper_kg < 0.0; }
};

/// Whether it can be asked at all: throws bad_request for torques in A, which say no mass, and for
/// a link that is not there or not the only last one. The estimates below ask it themselves.
void require_payload_question(const DynamicModel& model, const std::string& torque_unit,
                              const PayloadOptions& options = {});

/// The masses of the model are right but for the load. Throws undetermined where the motion does
/// not show the mass, bad_request for a link that is not there or not the only last one.
[[nodiscard]] PayloadEstimate estimate_payload(const DynamicModel& model,
                                               const TorqueSamples& loaded,
                                               const PayloadOptions& options = {});

/// Whatever the masses: two logs of one robot, whose motions may differ.
[[nodiscard]] PayloadEstimate estimate_payload(const DynamicModel& model,
                                               const TorqueSamples& loaded,
                                               const TorqueSamples& unloaded,
                                               const PayloadOptions& options = {});

/// From F_m(q) = (F(q, dq) + F(q, -dq)) / 2 at zero acceleration, which friction does not enter;
/// `unloaded` null: against the model's own masses. Intervals by leaving out one fold of the
/// learned torque after the other.
[[nodiscard]] PayloadEstimate payload_at_rest(const DynamicModel& model, const RobustTorque& loaded,
                                              const RobustTorque* unloaded,
                                              const PayloadOptions& options = {});

/// 97.5 % point of Student's t. Abramowitz and Stegun 26.7.5.
[[nodiscard]] double student_point(int freedom);

}  // namespace kinescope
