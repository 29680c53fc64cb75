// SPDX-License-Identifier: Apache-2.0
//
// What contact detection holds a log against: the masses of the URDF or of a log, the offsets and
// drive gains that no URDF has a place for.
#pragma once

#include <string>
#include <vector>

#include "app/commands/commands.h"
#include "dynamics/contact/balance.h"
#include "dynamics/data/torque_data.h"

namespace kinescope {

struct ContactModel {
  RigidBalance balance;
  Eigen::VectorXd gains;  ///< one a joint: measured = gain * torque of the balance
  std::string words;      ///< where masses, friction and offsets come from
  std::vector<LogFinding> findings;
};

/// `looked_at`: the log in which contacts are looked for, `learn` the one to learn from (the same
/// where there is no other). The URDF's masses serve where it has some, unless options.identify or
/// torques in A, which they say nothing about. Throws the refusals of compare_torque_scale (torques
/// in another unit or with another sign than the masses'), bad_input for logs in two units, and
/// what identification throws.
[[nodiscard]] ContactModel make_contact_model(const ContactCommandOptions& options,
                                              const DynamicModel& model,
                                              const TorqueLogReport& looked_at,
                                              const TorqueLogReport& learn);

}  // namespace kinescope
