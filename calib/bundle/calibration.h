// SPDX-License-Identifier: Apache-2.0
//
// The calibrated robot as a value: every parameter with its doubt, every residual, what was left
// out.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "calib/bundle/moving_camera.h"
#include "calib/camera/camera_model.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// A standard uncertainty (k = 1). Absent where the data do not determine the parameter.
using Sigma = std::optional<double>;

struct JointEstimate {
  Eigen::Vector3d axis_base =
      Eigen::Vector3d::UnitZ();  ///< unit, base frame, all joints at their mean value
  Eigen::Vector3d point_base = Eigen::Vector3d::Zero();  ///< m, a point of the axis, same posture
  /// Of the angle and of the distance to the true axis: twice it holds the error, whatever its
  /// direction, in 95 of 100 recordings. Position: revolute joints only.
  Sigma direction_sigma_rad;
  Sigma position_sigma_m;
  /// The same among the axes, wherever the base is: what moves all of them alike is taken out.
  /// Absent where nothing else could be seen (a single axis).
  Sigma among_direction_sigma_rad;
  Sigma among_position_sigma_m;
  Sigma offset_sigma;  ///< rad or m; where the offset was estimated
  Sigma scale_sigma;   ///< rad or m per unit; where the scale was estimated
  JointLimits range;   ///< of the joint value over the recording
  /// Value of the joint, rad or m, at whose frame the joint's turns and shifts among the parameters
  /// are taken: T_parent_joint * exp(axis * parameters_at).
  double parameters_at = 0.0;
};

struct MarkerEstimate {
  Sigma rotation_sigma_rad;  ///< of the error's length, as for joints
  Sigma translation_sigma_m;
  int used = 0;      ///< sightings used
  int rejected = 0;  ///< sightings left out as outliers
};

/// One line of the parameter table; the order is that of `Calibration::covariance`.
struct Parameter {
  std::string name;   ///< "joint2 axis tilt x"
  std::string block;  ///< "joint2", "tag_12", "camera", "clock", "intrinsics"
  std::string unit;   ///< "rad", "m", "s", "px", "", "rad/unit", ..
  double value =
      0.0;            ///< change against the start for tilts and shifts; the value itself otherwise
  Sigma sigma;        ///< standard uncertainty, noise correlated in time allowed for
  Sigma sigma_white;  ///< what independent noise alone would give
};

/// A combination of parameters that the data do not (or hardly) determine.
struct WeakDirection {
  double relative_singular_value = 0.0;  ///< against the largest, columns scaled to unit length
  std::vector<std::pair<int, double>> parameters;  ///< index, weight (largest first)
  std::string words;  ///< "this recording does not tell zero of joint3 and yaw of tag_4 apart"
};

struct Observability {
  double condition_number = 0.0;        ///< of the scaled Jacobian
  std::vector<double> singular_values;  ///< of the scaled Jacobian, largest first
  std::vector<WeakDirection> weak;
};

enum class MeasurementKind { kCorners, kPose, kPoint };

/// What one sighting says against the model: observed minus predicted.
struct SightingResidual {
  int frame = 0;
  TagId id;
  bool used = true;                          ///< false: rejected as an outlier
  int fold = -1;                             ///< the fold in which this frame was held out
  std::vector<Eigen::Vector2d> corners_px;   ///< final model; corners only
  std::vector<Eigen::Vector2d> held_out_px;  ///< model that has not seen this frame's fold
  std::vector<Eigen::Vector2d>
      before_px;  ///< the start (nominal model, or structure found from poses)
  /// The same as a displacement of the marker (rad, m), in the marker's frame for poses; for
  /// corners in the camera's axes (x right, y down, z forward), least squares over
  /// the corners.
  Vector6d displacement = Vector6d::Zero();
  Vector6d held_out_displacement = Vector6d::Zero();
  Vector6d before_displacement = Vector6d::Zero();
};

/// A camera beside the reference camera, whose numbers are members of Calibration.
struct CameraEstimate {
  std::string name;
  Pose T_camera_base;
  CameraModel camera;
  bool intrinsics_estimated = false;
  std::array<Sigma, kMaxIntrinsics> intrinsics_sigma{};
  double lag_s = 0.0;  ///< joint-log time = frame time + time_offset_s + lag_s
  Sigma lag_sigma_s;
  Sigma rotation_sigma_rad;  ///< of the pose in the base frame, of the error's length
  Sigma translation_sigma_m;
};

enum class CalibrationStatus { kNotRun, kConverged, kNotConverged, kUndetermined };

/// "not_run", "converged", "not_converged", "undetermined".
[[nodiscard]] std::string_view to_string(CalibrationStatus status);

// NOLINTNEXTLINE(clang-analyzer-optin.performance.Padding): ordered by meaning, and there are few
struct Calibration {
  CalibrationStatus status = CalibrationStatus::kNotRun;
  std::string status_reason;
  std::string status_remedy;  ///< what to check or record where nothing is determined
  MeasurementKind kind = MeasurementKind::kCorners;

  KinematicTree tree;  ///< base to links to markers
  /// The (reference) camera or tracker sees the base there; one that moves, in the middle one of
  /// the frames in which that is known.
  Pose T_camera_base;
  CameraModel camera;
  bool intrinsics_estimated = false;
  std::array<Sigma, kMaxIntrinsics> intrinsics_sigma{};
  double time_offset_s = 0.0;  ///< joint-log time = frame time + offset
  Sigma time_offset_sigma_s;
  Eigen::MatrixXd joint_values;  ///< frames x joints, rad or m; NaN where the log has a gap
  /// The same with what corrections turn or shift each joint by along its own axis: where the robot
  /// stood. What else they do to it (an axis that wobbles) no joint value can say. Of a joint that
  /// no channel drives without whole turns between frames, and NaN where no marker shows it.
  Eigen::MatrixXd corrected_values;
  std::vector<double> times_s;  ///< of the frames

  std::vector<JointEstimate> joints;    ///< beside tree.joints
  std::vector<MarkerEstimate> markers;  ///< beside tree.markers
  std::vector<Parameter> parameters;
  Eigen::MatrixXd covariance;  ///< of `parameters`, in their order and units
  std::string gauge;           ///< in words: what was held, and why nothing is lost by it
  Observability observability;

  std::vector<SightingResidual> residuals;
  double sigma_scale = 1.0;  ///< the noise found over the noise declared
  /// Distances, rms: px between corners, m between points (poses: between origins); of the folds'
  /// training parts.
  double training_rms = 0.0;
  double held_out_rms = 0.0;               ///< the same on the frames each fold left out
  double before_rms = 0.0;                 ///< the same with the start
  double final_rms = 0.0;                  ///< the same with all frames used
  double training_rotation_rms_rad = 0.0;  ///< poses only
  double held_out_rotation_rms_rad = 0.0;
  double before_rotation_rms_rad = 0.0;
  int folds = 0;
  double correlation_time_s = 0.0;  ///< over which residuals are alike; widens the uncertainties
  /// Variances over those of independent noise, mean over the parameters; what markers at rest add
  /// not counted in. Absent: read from a file that does not say.
  std::optional<double> noise_widening;
  int iterations = 0;
  double initial_cost = 0.0;
  double final_cost = 0.0;
  std::vector<std::string> warnings;

  std::optional<MovingCamera> moving;  ///< as estimated; none: cameras stand still

  std::string camera_name;  ///< of the reference camera; empty where there is one camera
  std::vector<CameraEstimate> further_cameras;  ///< 1, 2, .. of camera_of_frame
  std::vector<int> camera_of_frame;             ///< 0: the reference camera; empty: all frames
  /// As Measurements::starts_s: cameras are of recordings of their own.
  std::vector<double> starts_s;
  [[nodiscard]] bool of_recordings() const { return !starts_s.empty(); }
  /// On the clock of the frame's own recording, s.
  [[nodiscard]] double own_time_s(int frame) const {
    const double t = times_s[static_cast<std::size_t>(frame)];
    return of_recordings() ? t - starts_s[camera_at(frame)] : t;
  }
  [[nodiscard]] std::size_t camera_at(int frame) const {
    return camera_of_frame.empty()
               ? 0
               : static_cast<std::size_t>(camera_of_frame[static_cast<std::size_t>(frame)]);
  }
  [[nodiscard]] std::size_t cameras() const { return 1 + further_cameras.size(); }
  /// The reference camera is 0.
  [[nodiscard]] const std::string& name_of_camera(std::size_t c) const {
    return c == 0 ? camera_name : further_cameras[c - 1].name;
  }
  [[nodiscard]] const Pose& T_camera_base_of(std::size_t c) const {
    return c == 0 ? T_camera_base : further_cameras[c - 1].T_camera_base;
  }
  [[nodiscard]] const CameraModel& model_of_camera(std::size_t c) const {
    return c == 0 ? camera : further_cameras[c - 1].camera;
  }
};

/// T_camera_base in a frame, of the camera that the frame is of; `T_base_link`: the links in that
/// frame, which a camera on the robot needs.
[[nodiscard]] Pose camera_from_base(const Calibration& calibration, int frame,
                                    const std::vector<Pose>& T_base_link);

/// What one camera shows: sightings, and distances, rms: px from corner to corner, of poses and
/// points m.
struct CameraErrors {
  int used = 0;
  int rejected = 0;
  double final_rms = 0.0;     ///< of the fit to all frames
  double held_out_rms = 0.0;  ///< at postures that the fit has not seen
};

/// One a camera, the reference camera first.
[[nodiscard]] std::vector<CameraErrors> errors_of_cameras(const Calibration& calibration);

}  // namespace kinescope
