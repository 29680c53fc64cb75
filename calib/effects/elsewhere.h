// SPDX-License-Identifier: Apache-2.0
//
// What every effect that is at no joint is made of: of camera, clock and markers.
#pragma once

#include <string>
#include <vector>

#include "calib/effects/camera_effects.h"
#include "calib/trace/trace_result.h"

namespace kinescope::effects {

/// An effect at a place, still without corrections.
[[nodiscard]] CameraEffect effect(std::string name, std::string place, std::string words,
                                  std::vector<EffectParameter> parameters, std::string size_unit);

/// One of its parameters, 1 everywhere.
[[nodiscard]] Correction correct(CorrectedPart part, const CameraEffect& effect,
                                 std::size_t parameter, int index = kEverywhere);

/// Where an effect of one camera sits: its place where there is one camera; of several "camera
/// left", "camera left focal length".
[[nodiscard]] std::string place_at(const EffectWorld& world, std::size_t camera,
                                   const std::string& place);
/// The effect of one camera alone: it acts in that camera's frames. `place` begins with "camera".
[[nodiscard]] CameraEffect at_camera(const EffectWorld& world, std::size_t camera, CameraEffect of);

/// Beside a growth of the robot: the base need not be held where its frame is, but up to a metre
/// away, which by a growth of a millimetre a metre shifts all by a millimetre.
[[nodiscard]] std::vector<Correction> held_elsewhere(const CameraEffect& like,
                                                     const Eigen::VectorXd& share);

[[nodiscard]] Eigen::VectorXd frame_times(const EffectWorld& world);  ///< s

[[nodiscard]] std::string marker_name(const EffectWorld& world, int marker);
/// True of a marker that nothing moves before the camera.
[[nodiscard]] bool rests(const EffectWorld& world, int marker);
/// Joints that move the marker.
[[nodiscard]] std::vector<int> movers_of(const EffectWorld& world, int marker);
/// From the first to the last time at which one of these joints moves, s; before and behind all of
/// them keep their values.
[[nodiscard]] Interval motion_span(const EffectWorld& world, const std::vector<int>& joints);

}  // namespace kinescope::effects
