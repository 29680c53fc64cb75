// SPDX-License-Identifier: Apache-2.0
//
// Takes   options of a simulated arm whose masses and friction its controller does not know.
// Gives   how well it follows trajectories that no model has seen: nominal against learned.
// Units   rad, s, N m, kg.
// Method  one log of the arm under PD with nominal gravity teaches every model; all controllers
//         have the same gains, encoders, filters and limits (Nguyen-Tuong, Seeger, Peters 2008
//         compare models so). The payload is identified from one more log.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dynamics/control/servo.h"
#include "dynamics/identify/payload.h"
#include "kinematics/core/progress.h"

namespace kinescope::experiments {

struct WamControlOptions {
  int joints = 7;         ///< that move, counted from the base
  double learn_s = 40.0;  ///< of the log that is learned from
  double test_s = 10.0;   ///< of each unseen trajectory
  int tests = 3;
  double rate_hz = 500.0;
  double bandwidth_hz = 3.0;         ///< of the position loop
  double velocity_cutoff_hz = 40.0;  ///< half and double move joint 4's error by less than 1 %
  double encoder_step_rad = 3.6e-5;  ///< 4096 a turn of the motor, a transmission of 42
  double noise_nm = 0.05;
  double mass_error = 0.1;   ///< standard deviation of the nominal masses' relative error
  double sensor_kg = 0.254;  ///< at the wrist; the nominal arm has none
  double payload_kg = 0.5;   ///< carried beyond it in some runs
  std::vector<TorqueModelKind> kinds = {TorqueModelKind::kParametric, TorqueModelKind::kGip,
                                        TorqueModelKind::kSemiParametric};
  std::uint64_t seed = 1;
};

/// The arm with a sensor, as it is and as its controller believes it to be.
struct WamWorld {
  DynamicModel nominal;
  DynamicModel truth;  ///< without the payload
  std::vector<TorqueEffect> friction;
  InertialParameters payload;
};
[[nodiscard]] WamWorld wam_world(const WamControlOptions& options);
/// The plant of it, with friction that sticks.
[[nodiscard]] Plant wam_plant(const WamWorld& world, bool loaded);

/// One controller on all unseen trajectories; vectors have one entry a joint.
struct WamRow {
  std::string controller;
  bool loaded = false;
  Eigen::VectorXd error_rad;       ///< rms
  Eigen::VectorXd largest_rad;     ///< of all
  Eigen::VectorXd feedback_share;  ///< rms of the feedback over rms of the torque
  Eigen::VectorXd weight;          ///< mean of the learned part's
};

/// On the first unseen trajectory, without the payload.
struct WamTrace {
  std::string controller;
  Eigen::VectorXd t_s;
  Eigen::MatrixXd error_rad;  ///< samples x joints
};

struct WamControlResult {
  std::vector<std::string> joints;
  std::vector<std::string> effects;  ///< traced, "coulomb at joint1"
  std::vector<WamRow> rows;          ///< the first of each load is PD with nominal gravity
  PayloadEstimate payload;
  std::vector<WamTrace> traces;
};

[[nodiscard]] WamControlResult run_wam_control(const WamControlOptions& options, int threads,
                                               const Progress& progress = {});

/// A motion of the arm: sinusoids within its limits. Not the same for other numbers.
[[nodiscard]] TorqueSamples wam_reference(const DynamicModel& arm, double duration_s,
                                          double rate_hz, std::uint64_t seed, int number);

}  // namespace kinescope::experiments
