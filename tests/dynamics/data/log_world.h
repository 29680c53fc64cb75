// SPDX-License-Identifier: Apache-2.0
//
// A made-up robot in motion, as text: two revolute joints and a prismatic one, sums of sinusoids,
// torque = inertia ddq + gravity + Coulomb and viscous friction. Exact but for the noise that is
// asked for.
#pragma once

#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "dynamics/data/torque_data.h"

namespace kinescope {

inline constexpr double kTurn = 2.0 * std::numbers::pi;

struct LogWorldOptions {
  double duration_s = 10.0;
  double rate_hz = 200.0;
  double highest_hz = 1.0;      ///< of the motion
  double position_noise = 0.0;  ///< standard deviation, rad or m
  double velocity_noise = 0.0;
  double torque_noise = 0.0;
  double velocity_lag_s = 0.0;
  double torque_lag_s = 0.0;
  bool prismatic = true;     ///< the third joint
  std::string name = "log";  ///< seeds the motion
};

/// Columns t, q1.., dq1.., tau1..
struct LogWorld {
  std::vector<std::string> header;
  Eigen::MatrixXd rows;
  std::vector<WantedJoint> joints;
  Eigen::MatrixXd ddq;  ///< exact, as rows

  [[nodiscard]] Eigen::Index column(const std::string& name) const;
  /// The table as CSV; %.9g.
  [[nodiscard]] std::string csv() const;
};

[[nodiscard]] LogWorld make_log_world(const LogWorldOptions& options = {});

/// The exact motion of the world: q, dq, ddq of a joint at a time.
[[nodiscard]] Eigen::Vector3d exact_motion(const LogWorldOptions& options, int joint, double t_s);

/// A file in the test's temporary folder.
[[nodiscard]] std::filesystem::path write_log(const std::string& name, const std::string& text);

/// The message with which the function refuses, or "accepted".
[[nodiscard]] std::string refusal_of(const std::function<void()>& function);

}  // namespace kinescope
