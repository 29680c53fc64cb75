// SPDX-License-Identifier: Apache-2.0
//
// Takes   Measurements, a JointLog and a start (from the structure, or a nominal robot).
// Gives   Calibration: all parameters with covariance, residuals, held-out errors.
// Frames  gauge: the base frame is held to the first marker of the base link (or, where there is
// none, to
//         the reference camera); joint frames keep z on the axis and do not turn about or slide
//         along it.
// Method  bundle adjustment over the corners (or poses, or points) with Ceres; product of
// exponentials;
//         robust loss, then rejection and a plain refit; block-wise (sandwich) covariance.
// Not here: finding the structure, tracing what is left (calib/trace).
#pragma once

#include "calib/bundle/calibration.h"
#include "calib/bundle/correction.h"
#include "calib/bundle/measurements.h"
#include "calib/bundle/moving_camera.h"
#include "calib/camera/marker_set.h"
#include "kinematics/core/progress.h"
#include "kinematics/log/joint_log.h"

namespace kinescope {

/// What is estimated of the joints; each level includes the ones before it.
enum class FreeGeometry {
  kPlacement,  ///< only where the base and the markers are
  kOffsets,    ///< + the zero of every joint
  kGeometry    ///< + axes: direction and place
};

/// A camera beside the reference camera.
struct FurtherCamera {
  std::string name;
  Pose T_camera_base;
  CameraModel camera;
  double lag_s = 0.0;  ///< joint-log time = frame time + time offset + lag
  bool estimate_intrinsics = false;
};

/// Where the search starts, and what is held.
struct CalibrationStart {
  KinematicTree tree;
  Pose T_camera_base;  ///< of a camera that moves: anything
  CameraModel camera;
  double time_offset_s = 0.0;
  Eigen::MatrixXd joint_values;  ///< frames x joints where no channel drives; empty: none, or held
  bool nominal = false;  ///< the tree is a nominal robot: names, zeros and link frames are kept
  std::vector<Correction> corrections;  ///< of effects beyond the plain model; all are estimated
  std::string camera_name = {};         ///< of the reference camera; empty where there is one
  std::vector<FurtherCamera> further_cameras = {};  ///< 1, 2, .. of Measurements::camera_of_frame
  std::optional<MovingCamera> moving = {};          ///< of a single camera; none: it stands still
};

/// How far a robot is from its drawing: standard deviations of a prior on every joint's frame. A
/// zero gives way to data that say otherwise.
struct NominalSigmas {
  double rad = 0.01;
  double m = 5e-3;
};

struct CalibrateOptions {
  FreeGeometry free = FreeGeometry::kGeometry;
  bool estimate_intrinsics = false;  ///< of the reference camera; FurtherCamera has its own
  bool estimate_time_offset = true;
  bool estimate_scales = false;  ///< of channels that are declared in rad or m
  NominalSigmas nominal = {};
  /// Neither the robot nor the start's corrections are estimated: only where base and markers are,
  /// and the clock.
  bool hold_robot = false;
  double reject_sigma = 4.5;  ///< sightings beyond this many standard deviations are left out
  int folds = 5;              ///< of the cross-validation; 0: none
  std::vector<int> fold_of_frame = {};  ///< below `folds`, as another calibration of the same
                                        ///< measurements had them; empty: by posture
  bool folds_by_lot = false;  ///< frames dealt out at random instead of by posture: an easier test,
                              ///< as others report it
  int max_iterations = 100;
};

/// Throws undetermined when there is nothing to fit (no sighting with a joint value).
[[nodiscard]] Calibration calibrate(const Measurements& measurements, const MarkerSet& markers,
                                    const JointLog& log, const CalibrationStart& start,
                                    const CalibrateOptions& options = {},
                                    const Progress& progress = {});

}  // namespace kinescope
