// SPDX-License-Identifier: Apache-2.0
//
// Takes   poses of a robot's flange as its controller logs them, and markers that a camera saw
//         meanwhile: corners or poses. The camera is on the hand, or fixed and the markers on the
//         hand.
// Gives   HandEye: where the camera is on the hand (or before the base), where the markers are,
//         with covariance, errors on unseen poses, wrong rows, what is beside the equation.
// Frames  T_a_b maps b to a; perturbations on the right, rotation (rad) before translation (m).
// Method  closed forms (closed_form.h), bundle adjustment over corners (or poses) with Ceres;
//         variances of camera and controller by restricted maximum likelihood (noise.h); rival
//         readings by their predictive likelihood on unseen poses; effects by calib/trace.
// Not here: joints (calib/bundle), files (app/io).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/bundle/measurements.h"
#include "calib/camera/camera_model.h"
#include "calib/camera/marker_set.h"
#include "calib/hand_eye/hypothesis.h"
#include "calib/trace/trace_result.h"
#include "kinematics/core/progress.h"
#include "kinematics/log/pose_log.h"

namespace kinescope {

/// The log, one way to read its columns.
struct FlangeReading {
  std::string rotation;  ///< in words, of each reading its own: "quaternion", "rotation vector"
  PoseLog log;
  /// false: as another convention would have it. Such a one is judged where its closed form closes
  /// the loop better than those of all usual ones, and taken where it is clearly better.
  bool usual = true;
  FlangeDeclaration declaration = {};  ///< that says so; {}: nothing has to be said
};

struct HandEyeInput {
  Measurements measurements;  ///< corners or poses
  PoseTracks tracks;          ///< of the markers: where the search starts
  MarkerSet markers;
  CameraModel camera;                   ///< known; unused for poses
  std::vector<FlangeReading> readings;  ///< of one file: rivals; the first one is usual
  std::optional<CameraMount> mount;     ///< declared; none: to be told from the data
};

struct HandEyeOptions {
  double reject_sigma = 4.5;  ///< rows that contradict all others by more than this are left out
  int folds = 5;
  bool trace = true;  ///< look for effects beside the equation
};

/// A pose with the covariance of a right perturbation; rad, m.
struct UncertainPose {
  Pose T;
  Matrix6d covariance = Matrix6d::Zero();
};

struct HandEyeTarget {
  TagId id;
  UncertainPose pose;  ///< T_base_target (camera on the hand) or T_flange_target
  int frames = 0;      ///< in which it was seen and used
};

/// Distances between where targets are and where they are predicted, rms over frames.
struct HandEyeError {
  double m = 0.0;
  double rad = 0.0;
  double px = 0.0;  ///< between corners; 0 for poses
  int frames = 0;
};

/// One reading, judged on poses that its fit has not seen.
struct HandEyeRival {
  HandEyeHypothesis hypothesis;
  HandEyeError held_out;
  double log_score = 0.0;    ///< log predictive density less the best one's, same poses
  double probability = 0.0;  ///< of all rivals
  /// Predicts what the chosen one predicts (the same numbers under other names): told apart by
  /// what is usual alone.
  bool same_equation = false;
};

/// A row of the log that contradicts all others.
struct OddFlangeRow {
  double time_s = 0.0;
  std::optional<std::size_t> line;  ///< of the file, where a row has this very time
  Pose read;                        ///< as the log has it
  Pose expected;                    ///< in the log's direction
  double shift_m = 0.0;
  double turn_rad = 0.0;
};

struct HandEyeFrame {
  double time_s = 0.0;
  int fold = 0;
  bool used = false;
  HandEyeError fitted;                   ///< `frames` is 1
  std::optional<HandEyeError> held_out;  ///< none: left out
};

struct HandEye {
  HandEyeHypothesis hypothesis;
  std::vector<HandEyeRival> rivals;  ///< the chosen one first
  UncertainPose camera;              ///< T_flange_camera (on the hand) or T_base_camera
  std::vector<HandEyeTarget> targets;
  Eigen::MatrixXd covariance;     ///< camera, then each target: 6 (1 + targets)
  bool postures = false;          ///< at rest: nothing was interpolated
  double camera_noise = 1.0;      ///< over the declared sigmas
  double flange_noise_rad = 0.0;  ///< of the log's rotations, one axis
  double flange_noise_m = 0.0;    ///< of its positions, one axis
  HandEyeError fitted;
  HandEyeError held_out;
  std::vector<HandEyeFrame> frames;
  std::vector<OddFlangeRow> odd_rows;
  int odd_sightings = 0;       ///< of markers, left out: they contradict the others of their frames
  std::string start;           ///< the closed form that it began from
  std::optional<Trace> trace;  ///< none where it was not asked for
};

/// Throws undetermined: too few poses, no rotation or one about a single axis, directions that the
/// poses do not show, readings that predict alike.
[[nodiscard]] HandEye calibrate_hand_eye(const HandEyeInput& input,
                                         const HandEyeOptions& options = {},
                                         const Progress& progress = {});

}  // namespace kinescope
