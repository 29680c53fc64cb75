// SPDX-License-Identifier: Apache-2.0
//
// A joint under suspicion, and what every effect at a joint is made of.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "calib/effects/camera_effects.h"

namespace kinescope::effects {

struct Suspect {
  int joint = 0;  ///< of the tree
  std::string name;
  std::string unit;  ///< of its value, rad or m
  bool turns = true;
  Vector6d axis = Vector6d::Zero();  ///< as a twist in the link's frame
  Eigen::VectorXd value;             ///< frames
  /// How far apart the values stand: a wave shorter than twice that cannot be followed, it looks
  /// like a longer one. From one frame to the next; of postures, between those that differ.
  double step = 0.0;
};

[[nodiscard]] Suspect suspect(const EffectWorld& world, int joint);

/// What adds its share to the joint's value.
[[nodiscard]] Correction turn(const Suspect& s, std::string name, std::string unit,
                              Eigen::VectorXd share);

/// An effect at the joint, still without corrections.
[[nodiscard]] CameraEffect effect(const Suspect& s, std::string name, std::string words,
                                  std::vector<EffectParameter> parameters, std::string size_unit);

/// The size that the residual shows is the one that the log shows, or it is another effect's.
[[nodiscard]] std::function<bool(const Eigen::VectorXd&)> as_the_log_shows(double size);

/// An effect as large as that nobody overlooks: a fit that asks for it makes a wave or a ratio of
/// some other small thing, seen over a small range. `unit`: rad, m or empty (a ratio); infinite for
/// others.
[[nodiscard]] double largest_size(const std::string& unit);

}  // namespace kinescope::effects
