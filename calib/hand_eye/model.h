// SPDX-License-Identifier: Apache-2.0
//
// The hand-eye equation with what may stand beside it, as data (Model) and as numbers (State).
//   T_camera_target = T_mount_camera^-1  B  T_foot_target
//     camera on the hand   mount = flange, foot = base,   B = T_base_flange^-1
//     camera fixed         mount = base,   foot = flange, B = T_base_flange
// Internal to the room.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "calib/bundle/problem.h"
#include "calib/hand_eye/hypothesis.h"
#include "calib/trace/traced_model.h"
#include "kinematics/log/pose_log.h"

namespace kinescope::hand_eye {

/// An instant at which the log has a pose and the camera saw a target.
struct Frame {
  double time_s = 0.0;
  int index = 0;                            ///< among the measurements' frames
  std::vector<bundle::Sighting> sightings;  ///< Sighting::marker: index into Data::targets
};

struct Data {
  MeasurementKind kind = MeasurementKind::kCorners;
  CameraModel camera;
  std::vector<TagId> targets;
  std::vector<Frame> frames;  ///< by time
  bool postures = false;      ///< at rest: nothing to interpolate, no clock
  [[nodiscard]] double first_s() const { return frames.front().time_s; }
  [[nodiscard]] double last_s() const { return frames.back().time_s; }
  [[nodiscard]] double middle_s() const { return 0.5 * (first_s() + last_s()); }
};

/// Names of the effects (app/README.md, "Poses of a flange").
inline constexpr std::string_view kPositionScale = "position_scale";
inline constexpr std::string_view kTimeOffset = "time_offset";
inline constexpr std::string_view kClockDrift = "clock_drift";
inline constexpr std::string_view kCameraBump = "camera_bump";
inline constexpr std::string_view kTagSlip = "tag_slip";

[[nodiscard]] std::string target_name(TagId id);

/// What is measured, how it is read, which effects are in. Never changes while solving.
class Model {
 public:
  Model(const Data& data, const PoseLog& log, HandEyeHypothesis hypothesis,
        std::vector<AddedEffect> effects = {});

  [[nodiscard]] const Data& data() const { return *data_; }
  [[nodiscard]] const PoseLog& log() const { return *log_; }
  [[nodiscard]] const HandEyeHypothesis& hypothesis() const { return hypothesis_; }
  [[nodiscard]] const std::vector<AddedEffect>& effects() const { return effects_; }
  [[nodiscard]] bool has(std::string_view effect) const;
  /// Blocks of State::cameras and of State::targets that a frame looks through.
  [[nodiscard]] std::size_t camera_block(const Frame& frame) const;
  [[nodiscard]] std::size_t target_block(const Frame& frame, int target) const;
  /// Of a target before it slips.
  [[nodiscard]] std::size_t first_block(int target) const {
    return first_target_[static_cast<std::size_t>(target)];
  }
  /// Camera and targets.
  [[nodiscard]] Eigen::Index own_parameters() const {
    return 6 + 6 * static_cast<Eigen::Index>(data_->targets.size());
  }
  /// And those of the effects, behind them in their order.
  [[nodiscard]] Eigen::Index parameters() const;

 private:
  const Data* data_;
  const PoseLog* log_;
  HandEyeHypothesis hypothesis_;
  std::vector<AddedEffect> effects_;
  std::vector<double> bumps_;               // times, ascending
  std::vector<std::vector<double>> slips_;  // of every target, likewise
  std::vector<std::size_t> first_target_;   // block of every target, and one past the last
};

struct State {
  std::vector<bundle::PoseBlock> cameras;  ///< T_mount_camera, before and after each bump
  std::vector<bundle::PoseBlock> targets;  ///< T_foot_target, each before and after its slips
  std::array<double, 1> scale{};  ///< the log's positions are to be made longer by this share
  std::array<double, 1> lag_s{};  ///< log time minus frame time, in the middle of the frames
  std::array<double, 1> drift{};  ///< s of log time more than of frame time, a second
};

/// The same state for a model with more or other effects: what is new is zero.
[[nodiscard]] State state_for(const Model& model, const Model& from, const State& state);

/// T_base_flange at a frame with scale and lag in it, and what changes it.
struct FlangeAt {
  Pose T_base_flange;
  Vector6d by_time;   ///< right perturbation a second
  Vector6d by_scale;  ///< right perturbation a unit of scale
};
/// Where the lag leads past the log's ends, the end's pose.
[[nodiscard]] FlangeAt flange_at(const Model& model, const State& state, const Frame& frame);

/// A predicted pose of a target, and its right perturbations by those of what it is made of.
struct Predicted {
  Pose T_camera_target;
  Matrix6d by_camera;  ///< of T_mount_camera
  Matrix6d by_flange;  ///< of T_base_flange
  Vector6d by_time;
  Vector6d by_scale;
};
[[nodiscard]] Predicted predict(const Model& model, const State& state, const Frame& frame,
                                const FlangeAt& flange, int target);

/// A frame's rows at a state, whitened by what its sightings declare.
struct FrameRows {
  bool poses = false;            ///< three rows of turn, three of shift for each sighting
  Eigen::VectorXd residual;      ///< observed minus predicted
  Eigen::MatrixXd by_parameter;  ///< rows x Model::parameters(): of the residual
  Eigen::MatrixXd by_flange;     ///< rows x 6: of the residual, by a perturbation of T_base_flange
  std::vector<Predicted> predicted;           ///< of every sighting
  std::vector<bundle::SightingError> errors;  ///< of every sighting
};
/// Nothing where a target lies behind the camera.
[[nodiscard]] std::optional<FrameRows> rows_of(const Model& model, const State& state,
                                               const Frame& frame);

/// 6 (1 + targets) x parameters: perturbations of the camera and of each target as they are at the
/// end of the recording.
[[nodiscard]] Eigen::MatrixXd by_parameters_at_end(const Model& model, const State& state);
/// Those poses themselves: the camera's, then each target's.
[[nodiscard]] std::vector<Pose> poses_at_end(const Model& model, const State& state);

/// The values of one of the model's effects at a state.
[[nodiscard]] Eigen::VectorXd effect_values(const Model& model, const State& state,
                                            std::size_t effect);

}  // namespace kinescope::hand_eye
