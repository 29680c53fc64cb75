// SPDX-License-Identifier: Apache-2.0
//
// Measured robots of others: models as published and logs in joint units, cut where their authors
// cut them. Folders are those of the shared data; each has a README with origin and units.
#pragma once

#include <numbers>
#include <string>
#include <vector>

#include "dynamics/data/torque_log.h"
#include "dynamics/data/torque_samples.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

inline constexpr double kQuarterTurn = 0.5 * std::numbers::pi;

/// The rows from one time to another, both included.
[[nodiscard]] TorqueLog rows_between(const TorqueLog& log, double from_s, double to_s);

/// Currents of the UR10e as torques, with the drive gains (N m / A) of the literature.
[[nodiscard]] TorqueLog ur10e_log(const std::filesystem::path& folder, const std::string& file);
/// The same without the start-up motion of the first and last 3.8 s.
[[nodiscard]] TorqueLog ur10e_steady_log(const std::filesystem::path& folder,
                                         const std::string& file);

/// Motor side taken to the joints: gear ratios, and motor 6, which also turns with joint 5.
[[nodiscard]] TorqueLog tx40_log(const std::filesystem::path& folder);

[[nodiscard]] TorqueLog panda_log(const std::filesystem::path& folder);
[[nodiscard]] TorqueLog rokae_log(const std::filesystem::path& folder);
/// `run` 1 or 2: the same path twice.
[[nodiscard]] TorqueLog lwr4_log(const std::filesystem::path& folder, int run);

/// One joint turning about the vertical, no masses.
[[nodiscard]] DynamicModel lone_joint();
/// Friction torque of one joint, the rigid one taken out by the set's makers.
[[nodiscard]] TorqueLog franka_log(const std::filesystem::path& folder, const std::string& file,
                                   int joint);
/// Ten runs at constant speeds, one way; currents as torques (7.6 N m / A), start-up cut.
[[nodiscard]] TorqueLog kinova_log(const std::filesystem::path& folder);

/// A pendulum, no masses; zero hangs down.
[[nodiscard]] DynamicModel pendulum();
/// Runs of one servo with one load. The torque is the duty that its controller asks for.
struct PendulumLog {
  TorqueLog log;
  Eigen::VectorXd temperature_c;  ///< of every row
};
[[nodiscard]] PendulumLog pendulum_log(const std::filesystem::path& folder,
                                       const std::string& servo, double mass_kg, double length_m);
/// What a log says at the samples derived from it.
[[nodiscard]] Eigen::VectorXd at_samples(const TorqueLog& log, const Eigen::VectorXd& rows,
                                         const TorqueSamples& samples);

}  // namespace kinescope
