// SPDX-License-Identifier: Apache-2.0
//
// What a model of camera and encoders can lack: every effect at every place of a robot, as a
// candidate for tracing and as corrections of the bundle.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "calib/bundle/effect_bundle.h"
#include "calib/effects/error_table.h"
#include "calib/trace/traced_model.h"
#include "kinematics/log/unsteady_reading.h"

namespace kinescope::effects {

/// What effects are made from: the robot as the plain model has it, and how it moved.
struct EffectWorld {
  KinematicTree tree;
  std::vector<BundleCamera> cameras;  ///< the reference camera first
  std::vector<int> camera_of_frame;   ///< empty: there is one
  bool of_recordings = false;         ///< cameras are of recordings of their own
  LinkId camera_link{0};    ///< that carries the camera; 0: it stands still, or is carried
  bool is_carried = false;  ///< by a person: the camera's pose is free in every frame
  MeasurementKind kind = MeasurementKind::kCorners;
  bool postures = false;
  std::vector<int> driven;                  ///< joints
  std::vector<int> moving;                  ///< those of them that do, in more than one reading
  std::vector<int> seen;                    ///< markers
  std::map<int, std::vector<int>> seen_by;  ///< of each of them, the cameras
  JointMotion frames;
  JointMotion loaded;  ///< at the frames, with what effects add to the values: where loads act
  /// Of joints that sag, as the last fit has it: what each of their loads does, rad or m a unit.
  std::map<int, Eigen::VectorXd> sags;
  /// Likewise, of joints whose reading runs unevenly twice a turn: sine and cosine, rad.
  std::map<int, Eigen::Vector2d> bends;
  /// Of joints with play, how far ahead of its drive the link begins, rad or m.
  std::map<int, double> play_starts;
  JointMotion log;                              ///< finer in time; postures: in order
  std::map<int, UnsteadyReading> unsteady;      ///< joints whose reading in the log jumps
  std::optional<Eigen::Vector3d> gravity_base;  ///< unit vector, where it is known
  double first_s = 0.0;                         ///< of the frames
  double last_s = 0.0;
  bool clock_free = false;  ///< false: the log's clock is declared to agree with the camera's
  /// Effects are known and to be undone: also at joints that rest here, over whatever range.
  bool known = false;
};

/// px, what any detector's corners are off by.
inline constexpr double kUsualShift = 0.02;

/// Behind a joint's name, the nuisance that stands beside its play.
inline constexpr std::string_view kPlayStart = "place in its gap at the start";

/// Of the image's centre: cx, cy among the intrinsic parameters.
inline constexpr int kFirstOfCentre = 2;

/// Periods a turn of an eccentricity that is a bent coupling.
inline constexpr double kBendPeriods = 2.0;

[[nodiscard]] inline bool is_clock_offset(const EffectId& id) {
  return id.effect == "time_offset" && id.place == "clock";
}
/// Of when a frame is by the log, or a joint's reading.
[[nodiscard]] inline bool is_of_clock(const EffectId& id) {
  return id.effect == "time_offset" || id.effect == "clock_drift" || id.effect == "clock_jump";
}
[[nodiscard]] inline bool is_of_reading(const EffectId& id) {
  return id.effect == "quantisation" || id.effect == "reading_noise";
}
[[nodiscard]] inline bool is_sag(const EffectId& id) { return id.effect == "compliance"; }
[[nodiscard]] inline bool is_play(const EffectId& id) { return id.effect == "backlash"; }
[[nodiscard]] inline bool is_bend(const EffectId& id, double scan) {
  return id.effect == "eccentricity" && scan == kBendPeriods;
}

struct CameraEffect {
  Candidate candidate;  ///< without columns
  /// One correction a parameter; for the time offset the bundle's own parameter instead.
  std::function<std::vector<Correction>(double scan)> corrections;
  /// Nuisance parameters that the model has while the effect is in it. Empty: none.
  std::function<std::vector<Correction>(double scan)> nuisances;
  /// Of a curve: where it is tabulated and how certain it is there, by its parameters' covariance;
  /// its values there are `shares` times the parameters.
  std::function<ErrorTable(double scan, const Eigen::MatrixXd& covariance, Eigen::MatrixXd& shares)>
      table;
  bool is_time_offset = false;
  /// Gravity by the values of the nuisances. Empty: the effect knows nothing of it.
  std::function<Eigen::Vector3d(const Eigen::VectorXd&)> gravity_base;
  /// Candidate::size where the nuisances have these values. Empty: it does not depend on them.
  std::function<std::function<double(const Eigen::VectorXd& theta)>(const Eigen::VectorXd&)>
      size_beside;
};

/// Joints of those driven whose readings jump: in a log, or (`postures`) from posture to posture.
[[nodiscard]] std::map<int, UnsteadyReading> unsteady_readings(const JointMotion& motion,
                                                               const std::vector<int>& driven,
                                                               bool postures);

/// Of encoders, gears and joints: early_reading, encoder_scale, eccentricity, gear_error, backlash,
/// compliance, coupling, helical, curved_slider, axis_wobble, quantisation, reading_noise,
/// joint_map.
[[nodiscard]] std::vector<CameraEffect> joint_effects(const EffectWorld& world);

/// Of cameras, clock and markers: time_offset, clock_drift, rolling_shutter, lens_distortion,
/// intrinsics, blooming, tag_size, bent_tag. Not of a camera that is carried: rolling_shutter,
/// since how fast it moves is not known.
[[nodiscard]] std::vector<CameraEffect> camera_effects(const EffectWorld& world);

/// Of this recording alone, from a time on or growing with it: tag_slip, camera_bump, camera_drift,
/// focal_jump, focal_drift, thermal_growth, clock_jump, zero_jump, zero_drift. Not of a camera that
/// is carried: camera_bump, camera_drift; nor with one on the robot: thermal_growth.
[[nodiscard]] std::vector<CameraEffect> time_effects(const EffectWorld& world);

/// Of several recordings, what is another one in one of them: recording_zero, recording_mount,
/// recording_growth.
[[nodiscard]] std::vector<CameraEffect> recording_effects(const EffectWorld& world);

}  // namespace kinescope::effects
