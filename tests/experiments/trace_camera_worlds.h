// SPDX-License-Identifier: Apache-2.0
//
// The recordings of the tracing experiment: which effect sits where on which robot, and its twin.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tests/truth/camera_effects.h"

namespace kinescope {

/// A robot, its motion and its noise; effects are put into it.
struct TraceCase {
  truth::RobotKind kind = truth::RobotKind::kArm3;
  int seed = 0;
  int frames = 1000;           ///< of 33 s
  double sigma_px = 0.03;      ///< what refined corners of tags of 34 px have
  double floor_px = 0.0;       ///< smaller effects are not looked for; 0: tracing's own figure
  bool gravity_known = false;  ///< its direction is declared
  bool realistic = false;      ///< noise partly correlated in time, detector bias, encoder steps
};

[[nodiscard]] truth::EffectWorldOptions world_options(const TraceCase& of);
[[nodiscard]] truth::World world_with(const TraceCase& of,
                                      const std::vector<truth::InjectedEffect>& effects);

/// The effect at `strength` times the weakest, at one of the places where it shows: the seed picks.
/// Nothing where the robot has no such place.
[[nodiscard]] std::optional<truth::InjectedEffect> pick_effect(std::string_view effect,
                                                               double strength,
                                                               const TraceCase& of);

/// One of the places, at `strength` times its size; nothing where there is none.
[[nodiscard]] std::optional<truth::InjectedEffect> one_of(
    const std::vector<truth::InjectedEffect>& places, double strength, Rng rng);

[[nodiscard]] std::string describe(const truth::InjectedEffect& effect);

/// Length of the whitened shift of the corners that a calibration without the effect cannot take
/// up: what a perfect detector sees of the effect, in standard deviations of the noise.
[[nodiscard]] double visibility(const truth::InjectedEffect& effect, const TraceCase& of);

/// The same of corners with this noise, or of the poses that a tracker has of a world with `poses`.
[[nodiscard]] double visibility(const truth::InjectedEffect& effect,
                                const truth::EffectWorldOptions& world, double sigma_px);

/// Noise of a tracker: of one coordinate, and of a rotation about one axis.
inline constexpr double kTrackerSigmaM = 2e-4;
inline constexpr double kTrackerSigmaRad = 1e-3;

/// The truth as a structure search hands it on: moved by 0.3 deg and 1 mm.
[[nodiscard]] CalibrationStart start_of(const truth::World& world, const TraceCase& of);

}  // namespace kinescope
