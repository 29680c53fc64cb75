// SPDX-License-Identifier: Apache-2.0
//
// Robots in motion that are touched now and then: torque logs with exact truth. Joint motion is
// given (sums of sines), the torque follows by inverse dynamics, the contact by J' F.
#pragma once

#include <vector>

#include "dynamics/contact/contact_score.h"
#include "dynamics/data/torque_samples.h"
#include "dynamics/rigid/rigid_model.h"
#include "kinematics/core/rng.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope::experiments {

/// An arm of links in series, moderate masses, axes alternately across and along the links.
[[nodiscard]] DynamicModel contact_arm(int joints);

enum class ContactShape { kStep, kTrapezoid, kHalfSine };

struct ContactWorldOptions {
  double duration_s = 20.0;
  double rate_hz = 500.0;
  int contacts = 0;  ///< spread evenly, links in turn from the last to the first but one
  double contact_s = 0.2;
  double force_n = 25.0;
  ContactShape shape = ContactShape::kTrapezoid;
  bool at_reversal = false;            ///< contacts begin where joint 1 turns round
  double undeclared_coulomb_nm = 0.0;  ///< friction that the model does not know, all joints
  double missing_share = 0.0;          ///< samples with a NaN in them
  double position_quantum_rad = 4.8e-5;
  double velocity_sigma_rad_s = 1e-3;
  double torque_sigma_nm = 0.08;  ///< of joint 1; 0.6 times that of the joint before for the others
  Eigen::VectorXd torque_sigmas_nm = {};  ///< one a joint in place of these; empty: these
};

struct ContactWorld {
  TorqueSamples samples;
  std::vector<ContactLabel> labels;
  Eigen::MatrixXd external;  ///< true external torque, samples x joints
};

[[nodiscard]] ContactWorld contact_world(const DynamicModel& model,
                                         const ContactWorldOptions& options, Rng& rng);

}  // namespace kinescope::experiments
