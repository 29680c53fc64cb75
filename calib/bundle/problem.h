// SPDX-License-Identifier: Apache-2.0
//
// The bundle as data (Spec: what is measured, what is free) and as numbers (State: what is
// estimated), and the Ceres problem made of the two. Internal to the room: the only header beside
// pose_block.h that shows Ceres.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <ceres/evaluation_callback.h>
#include <ceres/problem.h>

#include "calib/bundle/calibrate.h"
#include "calib/bundle/chain.h"
#include "calib/bundle/pose_block.h"
#include "calib/camera/marker_shape.h"

namespace kinescope::bundle {

/// One marker (body, point) in one frame, ready to be compared with a prediction.
struct Sighting {
  MeasurementKind kind = MeasurementKind::kCorners;
  int frame = 0;
  int marker = 0;  ///< index into Spec::tree.markers
  int camera = 0;  ///< index into Spec::cameras
  int series = 0;  ///< of one camera and one marker: what neighbours in time are looked for in
  std::vector<Eigen::Vector2d> corners_px;    ///< corners
  std::vector<Eigen::Vector3d> geometry_m;    ///< corners in the marker's frame
  double sigma = 1.0;                         ///< px (corners) or m (points)
  double declared_sigma = 1.0;                ///< the same before any estimate of the noise
  Pose T_camera_marker;                       ///< poses
  Matrix6d whitening = Matrix6d::Identity();  ///< poses: W' W = inverse covariance
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< points with a measured place
  int target = -1;  ///< points held in an unknown place: index into Spec::targets
  [[nodiscard]] int dimension() const;
};

struct TargetPair {
  int from = 0;
  int to = 0;
  double distance_m = 0.0;
  double sigma_m = 0.0;
};

/// One camera; the first is the reference camera, on whose clock the frames' times are.
struct SpecCamera {
  std::string name;  ///< empty where there is one camera
  CameraModel model;
  TangentMask free_pose{};
  std::array<bool, kMaxIntrinsics> free_intrinsics{};
  bool free_lag = false;
};

/// What is measured, what is held, what is free. Never changes while solving.
struct Spec {
  MeasurementKind kind = MeasurementKind::kCorners;
  KinematicTree tree;  ///< joints and markers in the order of the State; the poses of the start
  std::vector<double> times_s;
  JointLog log;
  bool postures = false;  ///< measured at rest (is_posture_log): nothing to interpolate
  double max_gap_s = 0.5;
  std::vector<int> channel;  ///< of every joint; -1: none (value unknown, or a fixed joint)
  std::vector<std::vector<std::pair<int, double>>>
      couplings;                       ///< of every joint: further channels and their ratios
  std::vector<std::vector<int>> path;  ///< joints from the base (or the camera's link) to each link
  std::vector<bool> upward;  ///< joints that a path goes through from child to parent, of a camera
                             ///< on the robot; the same on all paths
  LinkId camera_link{0};     ///< that carries the camera; 0: it stands still, or is carried
  bool carried = false;      ///< the camera has a pose of its own in every frame
  std::vector<Sighting> sightings;  ///< by frame, then marker
  std::vector<std::string> targets;
  std::vector<TargetPair> distances;
  std::vector<SpecCamera> cameras;   ///< at least one
  std::vector<int> camera_of_frame;  ///< empty: there is one
  std::vector<double> starts_s;      ///< as Measurements::starts_s

  std::vector<TangentMask> free_joint;
  std::vector<TangentMask> free_mount;
  std::vector<bool> free_scale;
  std::vector<bool> free_offset;
  std::vector<bool> keeps_offset;  ///< a reading counts from a zero of its own, values do from the
                                   ///< drawn one; else the offset goes into the joint's frame
  std::vector<bool> free_value;    ///< joints whose value is unknown in every frame
  bool free_time_offset = false;
  std::vector<Correction> corrections;
  bool hold_corrections = false;       ///< false: all are free
  std::optional<NominalSigmas> prior;  ///< on the joint frames (nominal robots)
};

struct CameraState {
  PoseBlock base{};  ///< T_camera_base; of a camera on the robot T_camera_link
  std::array<double, kMaxIntrinsics> intrinsics{};
  std::array<double, 1> lag{};  ///< s that the log is further ahead of its frames' times
};

/// The estimated numbers. Addresses must not change while a problem built on them lives.
struct State {
  std::vector<CameraState> cameras;  ///< beside Spec::cameras; the reference camera has no lag
  std::vector<PoseBlock> carried;    ///< T_camera_base by frame; only where Spec::carried
  std::vector<PoseBlock> joint_frames;
  std::vector<std::array<double, 2>> joint_maps;  ///< scale, offset
  std::vector<PoseBlock> mounts;
  std::array<double, 1> time_offset{};
  std::vector<std::array<double, 3>> targets;
  std::vector<std::vector<double>> values;  ///< joint, frame; only where Spec::free_value
  std::vector<double> corrections;          ///< beside Spec::corrections
};

[[nodiscard]] State initial_state(const Spec& spec, const CalibrationStart& start);
/// Where the camera of a sighting stands: before its path.
[[nodiscard]] const PoseBlock& camera_block(const State& state, const Sighting& sighting);
[[nodiscard]] CameraModel camera_of(const Spec& spec, const State& state, std::size_t camera);

/// Frames x joints: joint-log time minus frame time, as the time offset and the cameras' lags have
/// it.
[[nodiscard]] Eigen::MatrixXd plain_clock(const Spec& spec, const State& state);
/// The same with corrections of the clock.
[[nodiscard]] Eigen::MatrixXd clock_of(const Spec& spec, const State& state);

/// Channel readings and rates at every frame for the present time offset: frames x joints.
class Readings {
 public:
  Readings(const Spec& spec, const State& state);
  Readings(const Spec& spec, Eigen::MatrixXd ahead_s);
  void update(const State& state);
  [[nodiscard]] double value(int frame, int joint) const { return value_(frame, joint); }
  [[nodiscard]] double rate(int frame, int joint) const { return rate_(frame, joint); }
  /// False where the log has nothing (outside, or in a gap).
  [[nodiscard]] bool known(int frame, int joint) const { return known_(frame, joint); }

 private:
  void read();

  const Spec* spec_;
  Eigen::MatrixXd ahead_s_;  // frames x joints: joint-log time minus frame time
  Eigen::MatrixXd value_;
  Eigen::MatrixXd rate_;
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> known_;
};

/// The joints on the way to a sighting's marker, at its instant.
[[nodiscard]] std::vector<ChainJoint> chain_of(const Spec& spec, const State& state,
                                               const Readings& readings, const Sighting& sighting);
/// Rates of the same joints, rad/s or m/s; 0 where no channel drives the joint.
[[nodiscard]] std::vector<double> rates_of(const Spec& spec, const State& state,
                                           const Readings& readings, const Sighting& sighting);
/// Without corrections.
[[nodiscard]] Pose predict(const Spec& spec, const State& state, const Readings& readings,
                           const Sighting& sighting);

/// Whitened observed minus predicted, and its derivatives.
struct SightingError {
  Eigen::VectorXd residual;                           ///< unitless
  Eigen::Matrix<double, Eigen::Dynamic, 6> d_marker;  ///< by right perturbation of T_camera_marker
  Eigen::Matrix<double, Eigen::Dynamic, kMaxIntrinsics> d_intrinsics;  ///< corners only
};

/// Nothing when a corner lies behind the camera. `target_m` takes the place of the measured
/// position.
[[nodiscard]] std::optional<SightingError> compare(const Sighting& sighting,
                                                   const Pose& T_camera_marker,
                                                   const CameraModel& camera,
                                                   const Eigen::Vector3d* target_m,
                                                   const MarkerShape& shape = {});
/// The residual alone.
[[nodiscard]] std::optional<Eigen::VectorXd> residual_of(const Sighting& sighting,
                                                         const Pose& T_camera_marker,
                                                         const CameraModel& camera,
                                                         const Eigen::Vector3d* target_m,
                                                         const MarkerShape& shape);

/// The error of one sighting at a state.
[[nodiscard]] std::optional<SightingError> error_of(const Spec& spec, const State& state,
                                                    const Readings& readings,
                                                    const Sighting& sighting);

/// A free block of parameters: one entry a free number in `names`, beside the tangent space's axes.
struct FreeBlock {
  double* data = nullptr;
  std::string block;
  std::vector<std::string> names;
  std::vector<std::string> units;
  std::vector<int> components;  ///< which of the block's numbers (poses: of the six) each name is
  int local_frame = -1;         ///< frame, for a joint value that is unknown in each frame
};

struct BuildOptions {
  std::optional<double>
      robust_width;  ///< Cauchy loss on a sighting's chi-square beyond this; none: squared
  bool freeze_globals = false;  ///< only joint values, and poses of the camera, per frame move
};

struct CorrectionBlock;

/// A Ceres problem over some of the sightings.
class BuiltProblem {
 public:
  BuiltProblem(const Spec& spec, State& state, const std::vector<int>& sightings,
               const BuildOptions& options);
  [[nodiscard]] ceres::Problem& problem() { return *problem_; }
  [[nodiscard]] const std::vector<FreeBlock>& blocks() const { return blocks_; }
  [[nodiscard]] const std::vector<ceres::ResidualBlockId>& sighting_ids() const { return ids_; }
  [[nodiscard]] const std::vector<ceres::ResidualBlockId>& prior_ids() const { return prior_ids_; }
  /// The camera's pose in every frame; empty: it has one.
  [[nodiscard]] const std::vector<double*>& camera_poses() const { return camera_poses_; }

 private:
  void add_sighting(const Spec& spec, State& state, int index,
                    const std::vector<CorrectionBlock>& corrections, const BuildOptions& options);
  void add_priors(const Spec& spec, State& state);
  void set_manifolds(const Spec& spec, State& state, const BuildOptions& options);
  void free_camera_poses(State& state);
  void free_pose(double* data, const TangentMask& mask, const std::string& block, bool frozen);
  void free_numbers(double* data, const std::vector<bool>& free, FreeBlock names, bool frozen);

  std::unique_ptr<Readings> readings_;
  std::unique_ptr<ceres::EvaluationCallback> callback_;
  std::unique_ptr<ceres::Problem> problem_;
  std::vector<ceres::ResidualBlockId> ids_;
  std::vector<ceres::ResidualBlockId> prior_ids_;
  std::vector<FreeBlock> blocks_;
  std::vector<double*> camera_poses_;
};

}  // namespace kinescope::bundle
