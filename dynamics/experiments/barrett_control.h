// SPDX-License-Identifier: Apache-2.0
//
// Takes   options of joint 4 of the simulated WAM, all other joints held.
// Gives   the closing experiment of Dang's report: learned on one sinusoid, compensated on another,
//         its tracking error before and after, and the motion over time (its figure 9).
// Units   rad, s, N m, kg.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dynamics/control/servo.h"
#include "dynamics/experiments/barrett.h"

namespace kinescope::experiments {

struct BarrettControlOptions {
  WamMotion learned = {1.3, 1.1, 1.2};      ///< the sinusoid that is learned from
  WamMotion compensated = {1.3, 0.4, 2.0};  ///< the other one, at 2 rad/s
  double learn_s = 30.0;
  double test_s = 15.0;
  double rate_hz = 500.0;
  /// With it PD errs by about the report's 0.06 rad: its gains are not published.
  double bandwidth_hz = 1.6;
  double velocity_cutoff_hz = 40.0;
  double encoder_step_rad = 3.6e-5;
  double motor_kgm2 = 0.08;
  BarrettOptions robot = {};  ///< sensor, friction, noise, seed
  std::vector<TorqueModelKind> kinds = {TorqueModelKind::kParametric, TorqueModelKind::kRbf,
                                        TorqueModelKind::kSemiParametric};
};

struct BarrettControlRow {
  std::string controller;
  double error_rad = 0.0;    ///< rms, from the second period on
  double largest_rad = 0.0;  ///< likewise
  double feedback_share = 0.0;
  double weight = 0.0;
  Eigen::VectorXd q_rad;  ///< over time
};

struct BarrettControlResult {
  std::vector<std::string> effects;
  Eigen::VectorXd t_s;
  Eigen::VectorXd reference_rad;
  std::vector<BarrettControlRow> rows;  ///< the first is PD with nominal gravity
};

/// The arm with all joints but one fixed at this posture (rad, one entry a moving joint).
[[nodiscard]] DynamicModel held_arm(DynamicModel arm, Eigen::Index joint,
                                    const Eigen::VectorXd& posture);

[[nodiscard]] BarrettControlResult run_barrett_control(const BarrettControlOptions& options,
                                                       int threads, const Progress& progress = {});

}  // namespace kinescope::experiments
