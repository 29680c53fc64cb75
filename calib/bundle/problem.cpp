// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/problem.h"

#include <algorithm>
#include <cmath>

#include <ceres/loss_function.h>
#include <fmt/format.h>

#include "calib/bundle/corrected.h"
#include "calib/bundle/costs.h"
#include "kinematics/core/error.h"

namespace kinescope::bundle {
namespace {

const std::array<const char*, kMaxIntrinsics> kIntrinsicNames{"fx", "fy", "cx", "cy", "d1", "d2",
                                                              "d3", "d4", "d5", "d6", "d7", "d8"};

// Keeps the readings at the clock that the solver is looking at.
class ReadingsCallback final : public ceres::EvaluationCallback {
 public:
  ReadingsCallback(Readings* readings, const State* state) : readings_(readings), state_(state) {}
  void PrepareForEvaluation(bool /*jacobians*/, bool new_point) override {
    if (new_point) readings_->update(*state_);
  }

 private:
  Readings* readings_;
  const State* state_;
};

double* corrections_at(State& state, const CorrectionBlock& block) {
  return &state.corrections[static_cast<std::size_t>(block.first)];
}

// What drives a joint at a time: its channel, and the others that move it too.
std::optional<ChannelValue> reading(const Spec& spec, std::size_t joint, double time_s) {
  auto sum = interpolate(spec.log, spec.channel[joint], time_s, spec.max_gap_s);
  for (const auto& [channel, ratio] : spec.couplings[joint]) {
    const auto other = interpolate(spec.log, channel, time_s, spec.max_gap_s);
    if (!sum || !other) return std::nullopt;
    sum->value += ratio * other->value;
    sum->rate += ratio * other->rate;
  }
  return sum;
}

}  // namespace

Eigen::MatrixXd plain_clock(const Spec& spec, const State& state) {
  Eigen::MatrixXd ahead_s = Eigen::MatrixXd::Constant(
      static_cast<Eigen::Index>(spec.times_s.size()),
      static_cast<Eigen::Index>(spec.tree.joints.size()), state.time_offset[0]);
  for (std::size_t f = 0; f < spec.camera_of_frame.size(); ++f) {
    const auto camera = static_cast<std::size_t>(spec.camera_of_frame[f]);
    ahead_s.row(static_cast<Eigen::Index>(f)).array() += state.cameras[camera].lag[0];
  }
  return ahead_s;
}

Eigen::MatrixXd clock_of(const Spec& spec, const State& state) {
  Eigen::MatrixXd ahead_s = plain_clock(spec, state);
  for (std::size_t c = 0; c < spec.corrections.size(); ++c) {
    const Correction& correction = spec.corrections[c];
    if (correction.part != CorrectedPart::kClock) continue;
    const bool everywhere = correction.index == kEverywhere;
    auto joints =
        ahead_s.middleCols(everywhere ? 0 : correction.index, everywhere ? ahead_s.cols() : 1);
    if (correction.share.size() == 0) {
      joints.array() += state.corrections[c];
    } else {
      joints.colwise() += state.corrections[c] * correction.share;
    }
  }
  return ahead_s;
}

State initial_state(const Spec& spec, const CalibrationStart& start) {
  State state;
  for (std::size_t c = 0; c < spec.cameras.size(); ++c) {
    CameraState& camera = state.cameras.emplace_back();
    const CameraModel& model = spec.cameras[c].model;
    camera.base =
        to_block(c == 0 ? start.T_camera_base : start.further_cameras[c - 1].T_camera_base);
    if (spec.camera_link.value != 0) camera.base = to_block(start.moving->T_camera_link);
    camera.lag[0] = c == 0 ? 0.0 : start.further_cameras[c - 1].lag_s;
    camera.intrinsics = {model.fx, model.fy, model.cx, model.cy};
    std::ranges::copy(model.distortion, camera.intrinsics.begin() + 4);
  }
  if (spec.carried) {
    for (const Pose& T_camera_base : start.moving->path)
      state.carried.push_back(to_block(T_camera_base));
  }
  for (std::size_t j = 0; j < spec.tree.joints.size(); ++j) {
    const Joint& joint = spec.tree.joints[j];
    state.joint_frames.push_back(to_block(joint.T_parent_joint));
    state.joint_maps.push_back({joint.scale, joint.offset});
    std::vector<double> values;
    if (spec.free_value[j]) {
      KINESCOPE_CHECK(start.joint_values.rows() == static_cast<Eigen::Index>(spec.times_s.size()),
                      "joints without a channel need a value in every frame");
      for (Eigen::Index f = 0; f < start.joint_values.rows(); ++f) {
        const double value = start.joint_values(f, static_cast<Eigen::Index>(j));
        values.push_back(std::isfinite(value) ? value : 0.0);
      }
    }
    state.values.push_back(std::move(values));
  }
  for (const Marker& marker : spec.tree.markers) {
    state.mounts.push_back(to_block(marker.T_link_marker));
  }
  state.time_offset[0] = start.time_offset_s;
  state.targets.resize(spec.targets.size());
  for (const Correction& correction : spec.corrections) {
    state.corrections.push_back(correction.value);
  }
  return state;
}

const PoseBlock& camera_block(const State& state, const Sighting& sighting) {
  return state.carried.empty() ? state.cameras[static_cast<std::size_t>(sighting.camera)].base
                               : state.carried[static_cast<std::size_t>(sighting.frame)];
}

Readings::Readings(const Spec& spec, const State& state) : Readings(spec, clock_of(spec, state)) {}

Readings::Readings(const Spec& spec, Eigen::MatrixXd ahead_s)
    : spec_(&spec), ahead_s_(std::move(ahead_s)) {
  read();
}

void Readings::update(const State& state) {
  Eigen::MatrixXd ahead_s = clock_of(*spec_, state);
  if (ahead_s == ahead_s_) return;
  ahead_s_ = std::move(ahead_s);
  read();
}

void Readings::read() {
  const auto frames = static_cast<Eigen::Index>(spec_->times_s.size());
  const auto joints = static_cast<Eigen::Index>(spec_->tree.joints.size());
  if (value_.rows() != frames) {
    value_ = Eigen::MatrixXd::Zero(frames, joints);
    rate_ = Eigen::MatrixXd::Zero(frames, joints);
    known_.setConstant(frames, joints, true);
  }
  for (std::size_t j = 0; j < spec_->tree.joints.size(); ++j) {
    if (spec_->channel[j] < 0) continue;
    for (std::size_t f = 0; f < spec_->times_s.size(); ++f) {
      const auto row = static_cast<Eigen::Index>(f);
      const auto column = static_cast<Eigen::Index>(j);
      const double time_s = spec_->times_s[f] + ahead_s_(row, column);
      // Where the clock moves a frame past the log's end while solving, the end's value stays.
      const double inside_s =
          std::clamp(time_s, spec_->log.times_s.front(), spec_->log.times_s.back());
      const auto sample = reading(*spec_, j, inside_s);
      known_(row, column) = sample.has_value() && inside_s == time_s;
      if (!sample) continue;
      value_(row, column) = sample->value;
      rate_(row, column) = spec_->postures ? 0.0 : sample->rate;
    }
  }
}

std::vector<ChainJoint> chain_of(const Spec& spec, const State& state, const Readings& readings,
                                 const Sighting& sighting) {
  const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
  std::vector<ChainJoint> joints;
  for (const int id : spec.path[marker.link.index()]) {
    const auto j = static_cast<std::size_t>(id);
    const double value =
        spec.free_value[j]
            ? state.values[j][static_cast<std::size_t>(sighting.frame)]
            : state.joint_maps[j][0] * readings.value(sighting.frame, id) + state.joint_maps[j][1];
    joints.push_back({spec.tree.joints[j].type, spec.tree.joints[j].axis,
                      from_block(state.joint_frames[j].data()), value, Vector6d::Zero(),
                      spec.upward[j]});
  }
  return joints;
}

std::vector<double> rates_of(const Spec& spec, const State& state, const Readings& readings,
                             const Sighting& sighting) {
  const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
  std::vector<double> rates;
  for (const int id : spec.path[marker.link.index()]) {
    const auto j = static_cast<std::size_t>(id);
    rates.push_back(
        spec.free_value[j] ? 0.0 : state.joint_maps[j][0] * readings.rate(sighting.frame, id));
  }
  return rates;
}

Pose predict(const Spec& spec, const State& state, const Readings& readings,
             const Sighting& sighting) {
  Pose pose = from_block(camera_block(state, sighting).data());
  for (const ChainJoint& joint : chain_of(spec, state, readings, sighting)) {
    const Pose motion = joint_motion(joint.type, joint.axis, joint.value);
    pose = joint.upward ? pose * (joint.T_parent_joint * motion).inverse()
                        : pose * joint.T_parent_joint * motion;
  }
  return pose * from_block(state.mounts[static_cast<std::size_t>(sighting.marker)].data());
}

BuiltProblem::BuiltProblem(const Spec& spec, State& state, const std::vector<int>& sightings,
                           const BuildOptions& options) {
  readings_ = std::make_unique<Readings>(spec, state);
  callback_ = std::make_unique<ReadingsCallback>(readings_.get(), &state);
  ceres::Problem::Options problem_options;
  problem_options.evaluation_callback = callback_.get();
  problem_options.enable_fast_removal = false;
  problem_ = std::make_unique<ceres::Problem>(problem_options);
  // Those that nothing shows are unknowns, too.
  const std::vector<CorrectionBlock> corrections = correction_blocks(spec);
  for (const CorrectionBlock& block : corrections)
    problem_->AddParameterBlock(corrections_at(state, block), block.count);
  for (const int index : sightings) add_sighting(spec, state, index, corrections, options);
  add_priors(spec, state);
  set_manifolds(spec, state, options);
}

void BuiltProblem::add_sighting(const Spec& spec, State& state, int index,
                                const std::vector<CorrectionBlock>& corrections,
                                const BuildOptions& options) {
  const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
  const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
  CameraState& camera = state.cameras[static_cast<std::size_t>(sighting.camera)];
  std::vector<double*> blocks{spec.carried
                                  ? state.carried[static_cast<std::size_t>(sighting.frame)].data()
                                  : camera.base.data()};
  for (const int id : spec.path[marker.link.index()]) {
    const auto j = static_cast<std::size_t>(id);
    blocks.push_back(state.joint_frames[j].data());
    blocks.push_back(spec.free_value[j] ? &state.values[j][static_cast<std::size_t>(sighting.frame)]
                                        : state.joint_maps[j].data());
  }
  blocks.push_back(state.mounts[static_cast<std::size_t>(sighting.marker)].data());
  blocks.push_back(state.time_offset.data());
  if (sighting.camera > 0) blocks.push_back(camera.lag.data());
  if (sighting.kind == MeasurementKind::kCorners) blocks.push_back(camera.intrinsics.data());
  if (sighting.target >= 0) {
    blocks.push_back(state.targets[static_cast<std::size_t>(sighting.target)].data());
  }
  std::vector<CorrectionBlock> bearing = correction_blocks_of(spec, corrections, sighting);
  for (const CorrectionBlock& block : bearing) blocks.push_back(corrections_at(state, block));
  ceres::LossFunction* loss =
      options.robust_width ? new ceres::CauchyLoss(*options.robust_width) : nullptr;
  ids_.push_back(problem_->AddResidualBlock(
      make_sighting_cost(spec, sighting, *readings_, std::move(bearing)), loss, blocks));
}

void BuiltProblem::add_priors(const Spec& spec, State& state) {
  for (const TargetPair& pair : spec.distances) {
    double* from = state.targets[static_cast<std::size_t>(pair.from)].data();
    double* to = state.targets[static_cast<std::size_t>(pair.to)].data();
    if (!problem_->HasParameterBlock(from) || !problem_->HasParameterBlock(to)) continue;
    // A measurement, not a prior: it counts among the data.
    ids_.push_back(problem_->AddResidualBlock(make_distance_cost(pair), nullptr, from, to));
  }
  for (const CorrectionBlock& block : correction_blocks(spec)) {
    for (int k = 0; k < block.count; ++k) {
      const double sigma = spec.corrections[static_cast<std::size_t>(block.first + k)].prior_sigma;
      if (!(sigma > 0.0)) continue;
      prior_ids_.push_back(problem_->AddResidualBlock(make_correction_prior(sigma, k, block.count),
                                                      nullptr, corrections_at(state, block)));
    }
  }
  if (!spec.prior) return;
  for (std::size_t j = 0; j < state.joint_frames.size(); ++j) {
    double* frame = state.joint_frames[j].data();
    const bool free = std::ranges::any_of(spec.free_joint[j], [](bool f) { return f; });
    if (!free || !problem_->HasParameterBlock(frame)) continue;
    prior_ids_.push_back(problem_->AddResidualBlock(
        make_frame_prior(*spec.prior, spec.tree.joints[j]), nullptr, frame));
    // A zero may be far off, of how the robot was put together or homed: the prior gives way.
    constexpr double kZeroLossWidth = 2.0;
    prior_ids_.push_back(
        problem_->AddResidualBlock(make_zero_prior(*spec.prior, spec.tree.joints[j]),
                                   new ceres::CauchyLoss(kZeroLossWidth), frame));
  }
}

void BuiltProblem::free_pose(double* data, const TangentMask& mask, const std::string& block,
                             bool frozen) {
  static const std::array<const char*, 6> kNames{"turn x",  "turn y",  "turn z",
                                                 "shift x", "shift y", "shift z"};
  if (!problem_->HasParameterBlock(data)) return;
  FreeBlock out{data, block, {}, {}, {}, -1};
  for (int i = 0; i < 6; ++i) {
    if (!mask[static_cast<std::size_t>(i)]) continue;
    out.names.push_back(fmt::format("{} {}", block, kNames[static_cast<std::size_t>(i)]));
    out.units.emplace_back(i < 3 ? "rad" : "m");
    out.components.push_back(i);
  }
  if (frozen || out.names.empty()) {
    problem_->SetParameterBlockConstant(data);
    return;
  }
  problem_->SetManifold(data, new PoseManifold(mask));
  blocks_.push_back(std::move(out));
}

void BuiltProblem::free_camera_poses(State& state) {
  static const std::vector<std::string> kNames{"turn x",  "turn y",  "turn z",
                                               "shift x", "shift y", "shift z"};
  static const std::vector<std::string> kUnits{"rad", "rad", "rad", "m", "m", "m"};
  for (std::size_t f = 0; f < state.carried.size(); ++f) {
    double* pose = state.carried[f].data();
    if (!problem_->HasParameterBlock(pose)) continue;
    problem_->SetManifold(pose, new PoseManifold({true, true, true, true, true, true}));
    camera_poses_.push_back(pose);
    blocks_.push_back({pose, "camera", kNames, kUnits, {0, 1, 2, 3, 4, 5}, static_cast<int>(f)});
  }
}

void BuiltProblem::free_numbers(double* data, const std::vector<bool>& free, FreeBlock names,
                                bool frozen) {
  if (!problem_->HasParameterBlock(data)) return;
  FreeBlock out{data, names.block, {}, {}, {}, -1};
  std::vector<int> held;
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (!free[i]) {
      held.push_back(static_cast<int>(i));
      continue;
    }
    out.names.push_back(names.names[i]);
    out.units.push_back(names.units[i]);
    out.components.push_back(static_cast<int>(i));
  }
  if (frozen || out.names.empty()) {
    problem_->SetParameterBlockConstant(data);
    return;
  }
  if (!held.empty()) {
    problem_->SetManifold(data, new ceres::SubsetManifold(static_cast<int>(free.size()), held));
  }
  blocks_.push_back(std::move(out));
}

void BuiltProblem::set_manifolds(const Spec& spec, State& state, const BuildOptions& options) {
  const bool frozen = options.freeze_globals;
  // Those of the reference camera are named as those of the only one.
  const auto named = [&](const char* what, std::size_t c) {
    return c == 0 ? std::string(what) : fmt::format("{} {}", what, spec.cameras[c].name);
  };
  for (std::size_t c = 0; c < spec.cameras.size(); ++c) {
    free_pose(state.cameras[c].base.data(), spec.cameras[c].free_pose, named("camera", c), frozen);
  }
  for (std::size_t j = 0; j < spec.tree.joints.size(); ++j) {
    const Joint& joint = spec.tree.joints[j];
    free_pose(state.joint_frames[j].data(), spec.free_joint[j], joint.name, frozen);
    const std::string unit = joint.type == JointType::kPrismatic ? "m" : "rad";
    if (!spec.free_value[j]) {
      free_numbers(state.joint_maps[j].data(), {spec.free_scale[j], spec.free_offset[j]},
                   {nullptr,
                    joint.name,
                    {joint.name + " scale", joint.name + " offset"},
                    {unit + "/unit", unit},
                    {},
                    -1},
                   frozen);
    }
  }
  for (std::size_t m = 0; m < spec.tree.markers.size(); ++m) {
    free_pose(state.mounts[m].data(), spec.free_mount[m],
              fmt::format("tag_{}", spec.tree.markers[m].id.value), frozen);
  }
  free_numbers(state.time_offset.data(), {spec.free_time_offset},
               {nullptr, "clock", {"time offset"}, {"s"}, {}, -1}, frozen);
  for (std::size_t c = 1; c < spec.cameras.size(); ++c) {
    const std::string block = named("clock", c);
    free_numbers(state.cameras[c].lag.data(), {spec.cameras[c].free_lag},
                 {nullptr, block, {block + " lag"}, {"s"}, {}, -1}, frozen);
  }
  for (std::size_t c = 0; c < spec.cameras.size(); ++c) {
    const SpecCamera& camera = spec.cameras[c];
    FreeBlock intrinsics{nullptr, named("intrinsics", c), {}, {}, {}, -1};
    for (std::size_t i = 0; i < kMaxIntrinsics; ++i) {
      intrinsics.names.push_back(c == 0 ? std::string(kIntrinsicNames[i])
                                        : fmt::format("{} of {}", kIntrinsicNames[i], camera.name));
      intrinsics.units.emplace_back(i < 4 ? "px" : "");
    }
    free_numbers(state.cameras[c].intrinsics.data(),
                 std::vector<bool>(camera.free_intrinsics.begin(), camera.free_intrinsics.end()),
                 intrinsics, frozen);
  }
  for (std::size_t t = 0; t < spec.targets.size(); ++t) {
    const std::string name = "target " + spec.targets[t];
    free_numbers(state.targets[t].data(), {true, true, true},
                 {nullptr, name, {name + " x", name + " y", name + " z"}, {"m", "m", "m"}, {}, -1},
                 frozen);
  }
  for (const CorrectionBlock& block : correction_blocks(spec)) {
    FreeBlock names{nullptr, "effects", {}, {}, {}, -1};
    for (int k = 0; k < block.count; ++k) {
      const Correction& correction = spec.corrections[static_cast<std::size_t>(block.first + k)];
      names.names.push_back(correction.name);
      names.units.push_back(correction.unit);
    }
    free_numbers(corrections_at(state, block),
                 std::vector<bool>(names.names.size(), !spec.hold_corrections), names, frozen);
  }
  free_camera_poses(state);
  for (std::size_t j = 0; j < spec.tree.joints.size(); ++j) {
    // The zero of a joint that no channel drives is free: its value in the first frame stays.
    bool zero_held = frozen;
    for (std::size_t f = 0; f < state.values[j].size(); ++f) {
      double* value = &state.values[j][f];
      if (!problem_->HasParameterBlock(value)) continue;
      if (!zero_held) {
        problem_->SetParameterBlockConstant(value);
        zero_held = true;
        continue;
      }
      const std::string name = fmt::format("{} value in frame {}", spec.tree.joints[j].name, f);
      blocks_.push_back({value, spec.tree.joints[j].name, {name}, {""}, {0}, static_cast<int>(f)});
    }
  }
}

}  // namespace kinescope::bundle
