// SPDX-License-Identifier: Apache-2.0
//
// All products of one run, gathered for its report.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/bundle/calibration.h"
#include "calib/bundle/check_nominal.h"
#include "calib/camera/marker_set.h"
#include "calib/effects/second_column.h"
#include "calib/effects/trace_calibration.h"
#include "calib/quality/error_summary.h"
#include "calib/quality/freedom_levels.h"
#include "calib/trace/trace_result.h"
#include "calib/vision/stills.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/structure/pose_tracks.h"
#include "kinematics/structure/structure.h"

namespace kinescope {

struct InputFile {
  std::string name;  ///< relative to the recording
  std::string sha256;
};

struct StageTime {
  std::string stage;
  double seconds = 0.0;
};

/// What was seen of one marker.
struct MarkerSummary {
  TagId id;
  double size_m = 0.0;
  int frames_seen = 0;
  double median_edge_px = 0.0;
  double median_sigma_px = 0.0;
};

/// A marker of one recording that is taken as another one than in the others.
struct MarkerAnew {
  TagId id;       ///< as its picture says
  TagId renamed;  ///< in the robot
  /// From where it sits in the others; absent where it sits on another link.
  std::optional<double> shift_m, turn_rad;
  Sigma shift_sigma_m, turn_sigma_rad;
};

/// One of several recordings that were calibrated together.
struct RecordingSummary {
  std::string name;
  double time_offset_s = 0.0;  ///< its log's time = its frames' time + offset
  Sigma time_offset_sigma_s;
  int used = 0;               ///< sightings
  double held_out_rms = 0.0;  ///< px or m: of postures that the model of all has not seen
  /// Of the same sightings by the robot that the other recordings show; its camera, its markers and
  /// its clock by its own other postures. Absent where the others do not show it.
  std::optional<double> by_others_rms;
  std::vector<MarkerAnew> anew;
};

struct RunSummary {
  std::string robot;                   ///< name
  std::string recording;               ///< folder name
  std::string entry;                   ///< "video", "corners", "poses", "points"
  std::string version;                 ///< of the program
  std::string command;                 ///< how to reproduce
  std::vector<std::string> arguments;  ///< the same, for a program
  std::string working_folder;          ///< that they are seen from
  std::vector<InputFile> inputs;
  std::vector<std::pair<std::string, std::string>> options;  ///< name, value
  std::vector<StageTime> times;

  int frames = 0;  ///< of the recording
  bool camera_declared = true;
  bool free_asked = false;  ///< how much of a nominal robot is free was the user's choice
  double duration_s = 0.0;
  std::vector<MarkerSummary> markers;
  std::vector<std::pair<std::string, int>> rejected;  ///< reason, count
  std::vector<std::string> warnings;                  ///< of reading and detection
  std::string camera_motion;  ///< how it is known whether the camera moves; empty: it stands still

  JointLog log;
  PoseTracks tracks;                   ///< empty for points
  std::optional<Structure> structure;  ///< none when a nominal robot was given
  std::optional<KinematicTree> nominal;
  std::vector<NominalFault> nominal_faults;  ///< mended before the fit
  std::vector<FreedomLevel> levels;          ///< of the nominal robot; empty without one
  Calibration calibration;
  std::optional<Trace> trace;                   ///< none where it was not asked for
  std::vector<FittedEffect> effects;            ///< that the calibration has in it
  std::vector<EffectId> shown_by_log;           ///< of them, what `correct` takes out of the log
  std::vector<SecondColumn> second_columns;     ///< of the joints' copies; none without a trace
  std::optional<Eigen::Vector3d> gravity_base;  ///< unit vector, where it is known
  ErrorSummary errors;
  std::vector<RecordingSummary> recordings;  ///< of several; empty: one
  std::vector<Still> film;  ///< some frames of the video, at times of the calibration's frames
  std::vector<std::string> torque;  ///< what the log's torques showed, in sentences; empty without
};

}  // namespace kinescope
