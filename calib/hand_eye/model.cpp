// SPDX-License-Identifier: Apache-2.0
#include "calib/hand_eye/model.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::hand_eye {
namespace {

// How many of the times have come at `time_s`.
std::size_t passed(const std::vector<double>& times_s, double time_s) {
  return static_cast<std::size_t>(std::ranges::upper_bound(times_s, time_s) - times_s.begin());
}

Matrix6d right_jacobian(const Vector6d& d) {
  const Matrix6d inverse = inverse_right_jacobian(d);
  Matrix6d out;
  for (Eigen::Index k = 0; k < 6; ++k)
    out.col(k) = least_squares(inverse, Matrix6d::Identity().col(k));
  return out;
}

// Perturbation of blocks[to] by one of blocks[0], where each further block is the one before times
// a motion that stays.
Matrix6d by_first(const std::vector<bundle::PoseBlock>& blocks, std::size_t first, std::size_t to) {
  const Pose later =
      bundle::from_block(blocks[to].data()).inverse() * bundle::from_block(blocks[first].data());
  return adjoint(later);
}

// The motion from a block to the next, and how blocks[to] answers to it.
Vector6d motion(const std::vector<bundle::PoseBlock>& blocks, std::size_t at) {
  return log_pose(bundle::from_block(blocks[at].data()).inverse() *
                  bundle::from_block(blocks[at + 1].data()));
}
Matrix6d by_motion(const std::vector<bundle::PoseBlock>& blocks, std::size_t at, std::size_t to) {
  return by_first(blocks, at + 1, to) * right_jacobian(motion(blocks, at));
}

Eigen::Index parameters_of(const AddedEffect& effect) {
  const std::string_view name = effect.id.effect;
  return name == kPositionScale || name == kTimeOffset || name == kClockDrift ? 1 : 6;
}

// Whether a parameter moves the target, or the camera (or what both look through).
bool is_of_target(const Model& model, int target, Eigen::Index column) {
  if (column < model.own_parameters()) return column >= 6;
  Eigen::Index next = model.own_parameters();
  for (const AddedEffect& effect : model.effects()) {
    next += parameters_of(effect);
    if (column >= next) continue;
    return effect.id.place == target_name(model.data().targets[static_cast<std::size_t>(target)]);
  }
  return false;
}

// Columns of one sighting: d residual / d parameter.
class Columns {
 public:
  Columns(const Model& model, const State& state, const Frame& frame)
      : model_(model), state_(state), frame_(frame) {}

  [[nodiscard]] Eigen::MatrixXd of(const bundle::Sighting& sighting, const Predicted& predicted,
                                   const Eigen::MatrixXd& d_target) const {
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(d_target.rows(), model_.parameters());
    const std::size_t camera = model_.camera_block(frame_);
    out.leftCols<6>() = d_target * predicted.by_camera * by_first(state_.cameras, 0, camera);
    const std::size_t first = model_.first_block(sighting.marker);
    const std::size_t target = model_.target_block(frame_, sighting.marker);
    out.middleCols<6>(6 + 6 * sighting.marker) = d_target * by_first(state_.targets, first, target);
    Eigen::Index column = model_.own_parameters();
    for (const AddedEffect& effect : model_.effects()) {
      const Eigen::Index count = parameters_of(effect);
      out.middleCols(column, count) = d_target * by_effect(effect, sighting, predicted);
      column += count;
    }
    return out;
  }

 private:
  [[nodiscard]] Eigen::MatrixXd by_effect(const AddedEffect& effect,
                                          const bundle::Sighting& sighting,
                                          const Predicted& predicted) const {
    if (effect.id.effect == kPositionScale) return predicted.by_scale;
    if (effect.id.effect == kTimeOffset) return predicted.by_time;
    if (effect.id.effect == kClockDrift)
      return predicted.by_time * (frame_.time_s - model_.data().middle_s());
    if (frame_.time_s < effect.scan) return Eigen::MatrixXd::Zero(6, 6);
    if (effect.id.effect == kCameraBump) {
      Frame at = frame_;
      at.time_s = effect.scan;
      const std::size_t after = model_.camera_block(at);
      return predicted.by_camera *
             by_motion(state_.cameras, after - 1, model_.camera_block(frame_));
    }
    const TagId id = model_.data().targets[static_cast<std::size_t>(sighting.marker)];
    if (effect.id.place != target_name(id)) return Eigen::MatrixXd::Zero(6, 6);
    Frame at = frame_;
    at.time_s = effect.scan;
    const std::size_t after = model_.target_block(at, sighting.marker);
    return by_motion(state_.targets, after - 1, model_.target_block(frame_, sighting.marker));
  }

  const Model& model_;
  const State& state_;
  const Frame& frame_;
};

}  // namespace

std::string target_name(TagId id) { return fmt::format("tag_{}", id.value); }

Model::Model(const Data& data, const PoseLog& log, HandEyeHypothesis hypothesis,
             std::vector<AddedEffect> effects)
    : data_(&data),
      log_(&log),
      hypothesis_(std::move(hypothesis)),
      effects_(std::move(effects)),
      slips_(data.targets.size()) {
  for (const AddedEffect& effect : effects_) {
    if (effect.id.effect == kCameraBump) bumps_.push_back(effect.scan);
    if (effect.id.effect != kTagSlip) continue;
    for (std::size_t k = 0; k < data.targets.size(); ++k)
      if (effect.id.place == target_name(data.targets[k])) slips_[k].push_back(effect.scan);
  }
  std::ranges::sort(bumps_);
  first_target_.push_back(0);
  for (std::vector<double>& times_s : slips_) {
    std::ranges::sort(times_s);
    first_target_.push_back(first_target_.back() + times_s.size() + 1);
  }
}

bool Model::has(std::string_view effect) const {
  return std::ranges::any_of(effects_, [&](const AddedEffect& e) { return e.id.effect == effect; });
}

std::size_t Model::camera_block(const Frame& frame) const { return passed(bumps_, frame.time_s); }

std::size_t Model::target_block(const Frame& frame, int target) const {
  return first_block(target) + passed(slips_[static_cast<std::size_t>(target)], frame.time_s);
}

Eigen::Index Model::parameters() const {
  Eigen::Index out = own_parameters();
  for (const AddedEffect& effect : effects_) out += parameters_of(effect);
  return out;
}

State state_for(const Model& model, const Model& from, const State& state) {
  State out;
  out.scale = model.has(kPositionScale) ? state.scale : std::array<double, 1>{};
  out.lag_s = model.has(kTimeOffset) ? state.lag_s : std::array<double, 1>{};
  out.drift = model.has(kClockDrift) ? state.drift : std::array<double, 1>{};
  // A block that both have begins at the same time in both.
  const auto blocks = [&](const Model& m) {
    std::vector<double> times_s{m.data().first_s()};
    for (const AddedEffect& e : m.effects())
      if (e.id.effect == kCameraBump) times_s.push_back(e.scan);
    std::ranges::sort(times_s);
    return times_s;
  };
  for (const double begin_s : blocks(model)) {
    Frame at;
    at.time_s = begin_s;
    out.cameras.push_back(state.cameras[from.camera_block(at)]);
  }
  for (std::size_t k = 0; k < model.data().targets.size(); ++k) {
    std::vector<double> times_s{model.data().first_s()};
    for (const AddedEffect& e : model.effects()) {
      const bool here = e.id.place == target_name(model.data().targets[k]);
      if (e.id.effect == kTagSlip && here) times_s.push_back(e.scan);
    }
    std::ranges::sort(times_s);
    for (const double begin_s : times_s) {
      Frame at;
      at.time_s = begin_s;
      out.targets.push_back(state.targets[from.target_block(at, static_cast<int>(k))]);
    }
  }
  return out;
}

FlangeAt flange_at(const Model& model, const State& state, const Frame& frame) {
  const PoseLog& log = model.log();
  const double later_s = state.lag_s[0] + state.drift[0] * (frame.time_s - model.data().middle_s());
  const double time_s = std::clamp(frame.time_s + later_s, log.times_s.front(), log.times_s.back());
  auto logged = pose_at(log, time_s);
  if (!logged) logged = pose_at(log, frame.time_s);
  KINESCOPE_CHECK(logged.has_value(), "a frame has a pose in the log");
  FlangeAt out{logged->pose, logged->twist, Vector6d::Zero()};
  if (model.hypothesis().direction == PoseDirection::kFlangeBase) {
    out.by_time = -adjoint(logged->pose) * logged->twist;
    out.T_base_flange = logged->pose.inverse();
  }
  const double longer = 1.0 + state.scale[0];
  Pose& T = out.T_base_flange;
  out.by_scale.tail<3>() = T.rotation.conjugate() * T.translation;
  T.translation *= longer;
  out.by_time.tail<3>() *= longer;
  return out;
}

Predicted predict(const Model& model, const State& state, const Frame& frame,
                  const FlangeAt& flange, int target) {
  const Pose X = bundle::from_block(state.cameras[model.camera_block(frame)].data());
  const Pose Y = bundle::from_block(state.targets[model.target_block(frame, target)].data());
  const bool on_hand = model.hypothesis().mount == CameraMount::kOnHand;
  const Pose B = on_hand ? flange.T_base_flange.inverse() : flange.T_base_flange;
  Predicted out;
  out.T_camera_target = X.inverse() * B * Y;
  // (X exp d)^-1 B Y = T exp(-Ad(T^-1) d);  X^-1 (F exp e)^-1 Y likewise, by way of B Y.
  out.by_camera = -adjoint(out.T_camera_target.inverse());
  out.by_flange = on_hand ? Matrix6d(-adjoint((B * Y).inverse())) : adjoint(Y.inverse());
  out.by_time = out.by_flange * flange.by_time;
  out.by_scale = out.by_flange * flange.by_scale;
  return out;
}

std::optional<FrameRows> rows_of(const Model& model, const State& state, const Frame& frame) {
  const FlangeAt flange = flange_at(model, state, frame);
  FrameRows out;
  out.poses = model.data().kind == MeasurementKind::kPose;
  Eigen::Index rows = 0;
  for (const bundle::Sighting& sighting : frame.sightings) {
    out.predicted.push_back(predict(model, state, frame, flange, sighting.marker));
    auto error = bundle::compare(sighting, out.predicted.back().T_camera_target,
                                 model.data().camera, nullptr);
    if (!error || !error->residual.allFinite()) return std::nullopt;
    rows += error->residual.size();
    out.errors.push_back(std::move(*error));
  }
  const Columns columns(model, state, frame);
  out.residual.resize(rows);
  out.by_parameter.resize(rows, model.parameters());
  out.by_flange.resize(rows, 6);
  Eigen::Index row = 0;
  for (std::size_t s = 0; s < frame.sightings.size(); ++s) {
    const bundle::SightingError& error = out.errors[s];
    const Eigen::Index n = error.residual.size();
    out.residual.segment(row, n) = error.residual;
    out.by_flange.middleRows(row, n) = error.d_marker * out.predicted[s].by_flange;
    out.by_parameter.middleRows(row, n) =
        columns.of(frame.sightings[s], out.predicted[s], error.d_marker);
    row += n;
  }
  return out;
}

std::vector<Pose> poses_at_end(const Model& model, const State& state) {
  const Frame& last = model.data().frames.back();
  std::vector<Pose> out{bundle::from_block(state.cameras[model.camera_block(last)].data())};
  for (int k = 0; k < static_cast<int>(model.data().targets.size()); ++k)
    out.push_back(bundle::from_block(state.targets[model.target_block(last, k)].data()));
  return out;
}

Eigen::MatrixXd by_parameters_at_end(const Model& model, const State& state) {
  // A sighting of each part whose residual is the part's own perturbation.
  const Columns columns(model, state, model.data().frames.back());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(model.own_parameters(), model.parameters());
  bundle::Sighting sighting;
  Predicted predicted;
  predicted.by_camera.setIdentity();
  predicted.by_flange.setZero();
  predicted.by_time.setZero();
  predicted.by_scale.setZero();
  for (int k = 0; k < static_cast<int>(model.data().targets.size()); ++k) {
    sighting.marker = k;
    const Eigen::MatrixXd both = columns.of(sighting, predicted, Matrix6d::Identity());
    Eigen::MatrixXd camera = both;
    Eigen::MatrixXd target = both;
    for (Eigen::Index c = 0; c < both.cols(); ++c)
      (is_of_target(model, k, c) ? camera : target).col(c).setZero();
    out.topRows<6>() = camera;
    out.middleRows<6>(6 + 6 * k) = target;
  }
  return out;
}

Eigen::VectorXd effect_values(const Model& model, const State& state, std::size_t effect) {
  const AddedEffect& added = model.effects()[effect];
  if (added.id.effect == kPositionScale) return Eigen::VectorXd::Constant(1, state.scale[0]);
  if (added.id.effect == kTimeOffset) return Eigen::VectorXd::Constant(1, state.lag_s[0]);
  if (added.id.effect == kClockDrift) return Eigen::VectorXd::Constant(1, state.drift[0]);
  Frame at;
  at.time_s = added.scan;
  if (added.id.effect == kCameraBump) return motion(state.cameras, model.camera_block(at) - 1);
  for (std::size_t k = 0; k < model.data().targets.size(); ++k) {
    if (added.id.place != target_name(model.data().targets[k])) continue;
    return motion(state.targets, model.target_block(at, static_cast<int>(k)) - 1);
  }
  return {};
}

}  // namespace kinescope::hand_eye
