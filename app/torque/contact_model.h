// SPDX-License-Identifier: Apache-2.0
//
// What contact detection holds a log against: the masses of the URDF or of a log, the offsets and
// drive gains that no URDF has a place for.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/torque/torque_options.h"
#include "dynamics/contact/drive_friction.h"
#include "dynamics/data/torque_data.h"
#include "dynamics/identify/identify.h"

namespace kinescope {

struct ContactModel {
  RigidModel rigid;                       ///< of the joints that it speaks of
  std::vector<Eigen::Index> joints;       ///< their columns in a log
  std::vector<SlidingFriction> friction;  ///< one each, of the log to learn from
  Eigen::VectorXd gains;  ///< one a joint of the log: measured = gain * torque of the balance
  std::optional<Identification> identified;  ///< behind it, where it was identified
  std::string words;                         ///< where masses, friction and offsets come from
  std::vector<LogFinding> findings;
};

/// `looked_at`: the log in which contacts are looked for, `learn` the one to learn from (the same
/// where there is no other). The URDF's masses serve where it has some, unless options.identify or
/// torques in A, which they say nothing about. Unmeasured joints have no friction that is known, so
/// that their torque is no evidence. Throws the refusals of compare_torque_scale (torques
/// in another unit or with another sign than the masses'), undetermined where masses are to be
/// identified and no joint slides, and what identification throws.
[[nodiscard]] ContactModel make_contact_model(const ContactCommandOptions& options,
                                              const DynamicModel& model,
                                              const TorqueLogReport& looked_at,
                                              const TorqueLogReport& learn);

/// The log as it was measured, each trajectory by itself, without the drives' gains.
[[nodiscard]] std::vector<TorqueSamples> unfiltered(const TorqueLog& log,
                                                    const Eigen::VectorXd& gains);

/// Joints that slide in the log, or at least change their place: the others are as good as fixed.
[[nodiscard]] std::vector<Eigen::Index> joints_in_motion(const RigidModel& rigid,
                                                         const TorqueLog& log);

/// Joints whose torque never changes in one of the logs, as of a dead sensor.
[[nodiscard]] std::vector<Eigen::Index> unmeasured_joints(const TorqueLog& looked_at,
                                                          const TorqueLog& learn);

/// The columns of these joints.
[[nodiscard]] TorqueSamples with_joints(const TorqueSamples& samples,
                                        const std::vector<Eigen::Index>& joints);

/// Standard deviation of the model's error from that of its parameters, in units of the noise of
/// its fit, which it is added to: of filtered samples x the model's joints.
struct ModelDoubt {
  TorqueSamples samples;
  Eigen::MatrixXd sigma;  ///< empty where masses were not identified, or the log is too short
};
[[nodiscard]] ModelDoubt model_doubt(const ContactModel& model, const TorqueLogReport& log,
                                     const TorqueDataOptions& options);

/// The balance of one motion as unfiltered() gives it, of all joints: one that the model does not
/// have may stick all the time, in an interval without end. `speeds_logged`: else those at the ends
/// are noisier than the others.
[[nodiscard]] std::vector<BalanceSample> balance_samples(const ContactModel& model,
                                                         const TorqueSamples& motion,
                                                         const ModelDoubt& doubt,
                                                         bool speeds_logged);

}  // namespace kinescope
