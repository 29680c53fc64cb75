// SPDX-License-Identifier: Apache-2.0
//
// Takes   a kind of robot, a noise, effects that nobody declares.
// Gives   a World: corners as a camera sees them with the effects in them; log, camera, tags and
//         tree as declared, that is without. The same seed with other effects is the same robot,
//         motion and noise: a twin.
// Method  mechanics.h for the robot; every corner is projected at the instant its row is exposed.
// Not here: pictures (render.h).
#pragma once

#include <vector>

#include "tests/truth/camera_world.h"
#include "tests/truth/filmed_robot.h"
#include "tests/truth/injected_effect.h"

namespace kinescope::truth {

struct EffectWorldOptions {
  std::uint64_t seed = 1;
  RobotKind kind = RobotKind::kArm3;
  int frames = 1000;
  double frame_rate_hz = 30.0;
  double log_rate_hz = 200.0;
  double amplitude_rad = 1.0;
  double rest_s = 0.0;  ///< at the beginning and the end
  double tag_size_m = 0.05;
  double scale = 1.0;                                ///< of the robot, not of its tags
  Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();  ///< gravity, base frame
  double sigma_px = 0.1;                             ///< noise of a corner's coordinate; 0: exact
  double correlated_share = 0.0;  ///< of the noise's variance, correlated in time
  double correlation_s = 0.3;     ///< its memory (an AR(1) process at every coordinate)
  double detector_bias_px = 0.0;  ///< outward, grows to this as a tag is seen from the side
  double encoder_step_rad = 0.0;  ///< the log is rounded to this; slides by the m per rad
  double clock_jitter = 0.1;      ///< of the log's stamps, share of their distance
  bool poses = false;             ///< of the tags, exact, beside the corners
  std::vector<InjectedEffect> effects;
};

/// The robot that make_effect_world films for the same options; to choose places on it.
[[nodiscard]] FilmedRobot robot_of(const EffectWorldOptions& options);

/// World::joint_values are the true ones; World::tree, T_camera_base, camera and markers are those
/// without effects (before a slip or a bump).
[[nodiscard]] World make_effect_world(const EffectWorldOptions& options);

/// Root mean square of the corners' shift between twins, px, over the sightings that both have.
[[nodiscard]] double twin_distance_px(const World& a, const World& b);

}  // namespace kinescope::truth
