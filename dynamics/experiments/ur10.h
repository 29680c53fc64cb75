// SPDX-License-Identifier: Apache-2.0
//
// The worlds of the UR10 experiment, after Dalla Libera and Carli 2020 (arXiv 1904.13317), section
// V: an arm that moves from one random point to another to be learned from; other such points and a
// circle to be judged on. The arm is simulated: published geometry and masses, drives of measured
// size.
#pragma once

#include <array>
#include <cstdint>

#include "dynamics/experiments/comparison_runs.h"

namespace kinescope::experiments {

/// What a drive adds to the link behind its gear, on the link's side.
struct ElasticDrive {
  double viscous_nms_rad = 0.0;
  double coulomb_nm = 0.0;
  double stiffness_nm_rad = 0.0;
  double noise_nm = 0.0;  ///< of the torque that its current tells, standard deviation
};

/// Friction as Mamedov and Mikhel 2020 identified it on a UR10e, and the noise that the currents of
/// their recordings have above 7 Hz, times their drive gains. Stiffness: nobody published one of a
/// UR10; that of strain wave gears of the maker's peak torques (330, 150, 56 N m: sizes 32, 25 and
/// 17 of Harmonic Drive's catalogue, its K1).
[[nodiscard]] const std::array<ElasticDrive, 6>& ur10_drives();

/// Motors from one random point of the joint space to the next and so on, each way with zero speed,
/// acceleration and jerk at its ends, at a random share of the maker's highest speeds; 125 Hz, as
/// the robot reports itself. Torques are zero. One trajectory.
[[nodiscard]] TorqueSamples random_points(int samples, Rng& rng);
/// The tool once and again around a circle in a plane that is drawn, its direction held, at a speed
/// that comes and goes.
[[nodiscard]] TorqueSamples tool_circle(int samples, Rng& rng);

/// The links behind their gears' springs, and the torque that each spring carries: the motors'
/// motion less torque / stiffness. One uninterrupted trajectory at one rate.
[[nodiscard]] TorqueSamples links_behind_springs(const DynamicModel& arm,
                                                 const TorqueSamples& motors);

struct Ur10Options {
  int samples = 4000;       ///< to learn from, evenly chosen of 40000 or more
  int test_samples = 2500;  ///< without noise: half of them random points, half a circle
  std::uint64_t seed = 1;
};

/// The paper's sizes, at least: 40000 samples (320 s) to learn from and 25000 to be judged on, of
/// which `samples` and `test_samples` are evenly chosen: fewer samples are of the same motion.
/// Position, speed and acceleration of the motors, and the torque that their currents tell. The
/// test has two trajectories: "random points" and "circle". The geometry believed is the true one.
[[nodiscard]] ComparisonCase ur10_case(int run, const Ur10Options& options);

}  // namespace kinescope::experiments
