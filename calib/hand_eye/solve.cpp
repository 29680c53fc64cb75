// SPDX-License-Identifier: Apache-2.0
#include "calib/hand_eye/solve.h"

#include <algorithm>
#include <cmath>

#include <ceres/ceres.h>

#include "calib/bundle/pose_block.h"
#include "kinematics/core/silence_glog.h"

namespace kinescope::hand_eye {
namespace {

constexpr std::size_t kPoseSize = 7;

// One frame. Blocks: the camera's, that of each target seen, the scale, the lag.
class FrameCost final : public ceres::CostFunction {
 public:
  FrameCost(const Model& model, const State& layout, const Frame& frame, Whitening whitening,
            Eigen::Index rows)
      : model_(&model), layout_(&layout), frame_(&frame), whitening_(std::move(whitening)) {
    set_num_residuals(static_cast<int>(rows));
    auto& sizes = *mutable_parameter_block_sizes();
    sizes.assign(1 + frame.sightings.size(), kPoseSize);
    sizes.insert(sizes.end(), 3, 1);
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const State state = state_at(parameters);
    const auto rows = rows_of(*model_, state, *frame_);
    if (!rows) return false;
    Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()) = whitening_.apply(rows->residual);
    if (jacobians != nullptr) fill(*rows, parameters, jacobians);
    return true;
  }

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  // Only the blocks that this frame looks through are read.
  [[nodiscard]] State state_at(double const* const* parameters) const {
    State state = *layout_;
    const auto copy = [](const double* from, bundle::PoseBlock& to) {
      std::copy(from, from + kPoseSize, to.begin());
    };
    copy(parameters[0], state.cameras[model_->camera_block(*frame_)]);
    const std::size_t n = frame_->sightings.size();
    for (std::size_t s = 0; s < n; ++s) {
      copy(parameters[1 + s],
           state.targets[model_->target_block(*frame_, frame_->sightings[s].marker)]);
    }
    state.scale[0] = parameters[1 + n][0];
    state.lag_s[0] = parameters[2 + n][0];
    state.drift[0] = parameters[3 + n][0];
    return state;
  }

  void fill(const FrameRows& rows, double const* const* parameters, double** jacobians) const {
    const std::size_t n = frame_->sightings.size();
    const Eigen::Index all = num_residuals();
    Eigen::MatrixXd camera = Eigen::MatrixXd::Zero(all, 6);
    Eigen::MatrixXd numbers = Eigen::MatrixXd::Zero(all, 3);
    Eigen::Index row = 0;
    for (std::size_t s = 0; s < n; ++s) {
      const auto& d = rows.errors[s].d_marker;
      const Predicted& p = rows.predicted[s];
      camera.middleRows(row, d.rows()) = d * p.by_camera;
      numbers.block(row, 0, d.rows(), 1) = d * p.by_scale;
      numbers.block(row, 1, d.rows(), 1) = d * p.by_time;
      if (jacobians[1 + s] != nullptr) {
        Eigen::MatrixXd target = Eigen::MatrixXd::Zero(all, 6);
        target.middleRows(row, d.rows()) = d;
        put_pose(target, parameters[1 + s], jacobians[1 + s]);
      }
      row += d.rows();
    }
    if (jacobians[0] != nullptr) put_pose(camera, parameters[0], jacobians[0]);
    numbers.col(2) = numbers.col(1) * (frame_->time_s - model_->data().middle_s());
    const Eigen::MatrixXd whitened = whitening_.apply(numbers);
    for (std::size_t k = 0; k < 3; ++k) {
      double* out = jacobians[1 + n + k];
      if (out == nullptr) continue;
      Eigen::Map<Eigen::VectorXd>(out, all) = whitened.col(static_cast<Eigen::Index>(k));
    }
  }

  void put_pose(const Eigen::MatrixXd& by_tangent, const double* block, double* out) const {
    Eigen::Map<RowMajor>(out, num_residuals(), kPoseSize) =
        whitening_.apply(by_tangent) * bundle::minus_jacobian(bundle::from_block(block));
  }

  const Model* model_;
  const State* layout_;
  const Frame* frame_;
  Whitening whitening_;
};

void hold(ceres::Problem& problem, std::array<double, 1>& number, bool free) {
  problem.AddParameterBlock(number.data(), 1);
  if (!free) problem.SetParameterBlockConstant(number.data());
}

// Each sighting for itself: one wrong marker does not spoil the others of its frame.
std::vector<Frame> parts_of(const Frame& frame, bool robust) {
  if (!robust) return {frame};
  std::vector<Frame> out;
  for (const bundle::Sighting& sighting : frame.sightings)
    out.push_back({frame.time_s, frame.index, {sighting}});
  return out;
}

// `frame` outlives the problem.
void add_frame(const Model& model, const State& layout, State& state, const Frame& frame,
               const Noise& noise, bool robust, ceres::Problem& problem) {
  const auto rows = rows_of(model, layout, frame);
  if (!rows) return;
  const Eigen::Index n = rows->residual.size();
  std::vector<double*> blocks{state.cameras[model.camera_block(frame)].data()};
  for (const bundle::Sighting& sighting : frame.sightings)
    blocks.push_back(state.targets[model.target_block(frame, sighting.marker)].data());
  blocks.push_back(state.scale.data());
  blocks.push_back(state.lag_s.data());
  blocks.push_back(state.drift.data());
  // Of a frame without fault the squares sum up to about its rows.
  ceres::LossFunction* loss =
      robust ? new ceres::CauchyLoss(std::sqrt(static_cast<double>(n))) : nullptr;
  problem.AddResidualBlock(new FrameCost(model, layout, frame, Whitening(noise, *rows), n), loss,
                           blocks);
}

}  // namespace

Solved solve(const Model& model, const State& start, const Noise& noise,
             const std::vector<std::size_t>& frames, bool robust) {
  silence_glog();
  Solved out{start, false};
  ceres::Problem problem;
  hold(problem, out.state.scale, model.has(kPositionScale));
  hold(problem, out.state.lag_s, model.has(kTimeOffset));
  hold(problem, out.state.drift, model.has(kClockDrift));
  std::vector<std::vector<Frame>> parts;
  for (const std::size_t f : frames) parts.push_back(parts_of(model.data().frames[f], robust));
  for (const std::vector<Frame>& of_frame : parts)
    for (const Frame& part : of_frame)
      add_frame(model, start, out.state, part, noise, robust, problem);
  for (std::vector<bundle::PoseBlock>* blocks : {&out.state.cameras, &out.state.targets}) {
    for (bundle::PoseBlock& block : *blocks) {
      if (!problem.HasParameterBlock(block.data())) continue;
      problem.SetManifold(block.data(), new bundle::PoseManifold({1, 1, 1, 1, 1, 1}));
    }
  }
  ceres::Solver::Options options;
  options.max_num_iterations = 100;
  options.linear_solver_type = ceres::DENSE_QR;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  out.converged = summary.IsSolutionUsable();
  return out;
}

std::vector<std::optional<FrameRows>> rows_of_all(const Model& model, const State& state) {
  std::vector<std::optional<FrameRows>> out;
  for (const Frame& frame : model.data().frames) out.push_back(rows_of(model, state, frame));
  return out;
}

}  // namespace kinescope::hand_eye
