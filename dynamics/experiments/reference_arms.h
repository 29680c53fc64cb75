// SPDX-License-Identifier: Apache-2.0
//
// Arms that papers on inverse dynamics learn, and the sums of sinusoids that they are moved along.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "dynamics/data/torque_samples.h"
#include "kinematics/core/rng.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

/// A serial arm by modified Denavit-Hartenberg rows (a, alpha, d), Craig's convention, no masses.
[[nodiscard]] DynamicModel dh_arm(const std::vector<std::array<double, 3>>& rows);

/// The Panda's kinematics from its maker's data sheet, with position limits and without masses.
[[nodiscard]] DynamicModel panda_kinematics();
/// The same with the masses of Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca 2019, as the maker's
/// public description of the arm lists them.
[[nodiscard]] DynamicModel panda_arm();

/// The UR10 (CB3) as its maker publishes it ("DH parameters for calculations of kinematics and
/// dynamics", universal-robots.com): geometry and position limits, without masses.
[[nodiscard]] DynamicModel ur10_kinematics();
/// The same with the masses, centres of mass and inertias of that page.
[[nodiscard]] DynamicModel ur10_arm();

/// R R P R with vertical axes; masses and lengths of a mid-size SCARA, made up.
[[nodiscard]] DynamicModel scara_arm();

/// The arm as somebody might believe it to be: every joint tilted and moved on its parent by normal
/// amounts about, and along, each axis.
[[nodiscard]] DynamicModel misplaced(DynamicModel model, double tilt_rad, double shift_m, Rng& rng);

struct SinusoidOptions {
  int samples = 2000;
  double rate_hz = 100.0;
  int sines = 200;  ///< a joint
  double lowest_hz = 0.02;
  double highest_hz = 1.0;
  double range_share = 0.5;  ///< of the joint's range that the motion fills
};

/// q, dq, ddq of every joint: sines with uniform frequencies and phases and normal amplitudes,
/// about the middle of the range. Torques without friction and noise.
[[nodiscard]] TorqueSamples sinusoid_log(const DynamicModel& model, const SinusoidOptions& options,
                                         Rng& rng);

/// The trajectories of Giacomuzzo, Carli, Romeres, Dalla Libera 2024, section VI-A: 50 harmonics of
/// 0.02 rad/s, coefficients uniform within a tenth of the range, which shrinks until position,
/// velocity and acceleration stay within the Panda's limits (positions: the middle half); 50 s,
/// every tenth sample of 100 Hz.
[[nodiscard]] TorqueSamples panda_log(const DynamicModel& model, Rng& rng);

/// White normal noise of this standard deviation, in the torque's unit, on every torque.
void add_white_noise(TorqueSamples& samples, const Eigen::RowVectorXd& sigma, Rng& rng);

}  // namespace kinescope
