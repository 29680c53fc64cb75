// SPDX-License-Identifier: Apache-2.0
//
// Logs of known robots whose torques hold effects that their models do not declare. Every effect is
// made here from its physics, by other means than the library's: a Dahl friction by integrating its
// equation, a delay by looking at an earlier time, a payload by a heavier robot.
#pragma once

#include <string>
#include <vector>

#include "dynamics/data/torque_log.h"
#include "kinematics/core/rng.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

/// `strength`: torque of the effect over the joint's rms torque, about; kg for a payload (or for
/// one that is picked up in the log) over the mass of its link; degrees for gravity; seconds for a
/// delay; shares for gain and cross-talk.
struct TrueEffect {
  std::string effect;
  int joint = 0;
  int other = 0;  ///< cross-talk: whose torque
  double strength = 0.1;
  bool operator==(const TrueEffect&) const = default;
};

/// An effect as it was put in: its place and size in the library's terms.
struct KnownEffect {
  std::string effect;
  std::string place;
  double size = 0.0;
};

struct EffectWorldOptions {
  int joints = 5;
  double prismatic_share = 0.15;
  double duration_s = 30.0;
  double rate_hz = 250.0;
  double amplitude_rad = 1.3;
  double highest_hz = 0.5;
  double noise = 0.01;        ///< standard deviation, share of each joint's rms torque
  double noise_memory = 0.0;  ///< AR(1), from sample to sample
  double position_noise_rad = 1e-5;
  double declared_coulomb = 0.1;  ///< friction that the model does declare, over the rms torque
  double declared_viscous = 0.1;
  double width_rad_s = 0.006;  ///< of the turn of the true friction
};

struct EffectWorld {
  DynamicModel model;  ///< as declared: everything but the effects
  TorqueLog log;
  std::vector<KnownEffect> effects;
  Eigen::MatrixXd torque;  ///< without noise
};

[[nodiscard]] EffectWorld effect_world(const std::vector<TrueEffect>& effects,
                                       const EffectWorldOptions& options, Rng& rng);

/// Names of all effects this can make that the library knows.
[[nodiscard]] std::vector<std::string> known_torque_effects();

}  // namespace kinescope
