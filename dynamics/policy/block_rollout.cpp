// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/block_rollout.h"

#include <algorithm>

#include "dynamics/policy/draws.h"
#include "kinematics/core/error.h"

namespace kinescope::policy {

using Eigen::Index;

PreparedModel::PreparedModel(const VelocityModel& model)
    : layout(model.layout),
      physics(model.physics),
      features(feature_count(model.layout)),
      columns(features + model.layout.input_count()) {
  KINESCOPE_CHECK(static_cast<Index>(model.processes.size()) == layout.position_count(),
                  "one process a position");
  for (const VelocityProcess& process : model.processes) {
    posteriors.emplace_back(process, physics.get());
    if (!process.kernel.factors.empty()) linear = physics ? physics->count() : columns;
  }
}

BlockRollout::BlockRollout(const PreparedModel& model, const PolicyTask& task, Index basis_count,
                           Index rows)
    : model_(model),
      task_(task),
      rows_(rows),
      filter_(model.layout, task.sensing, rows),
      states_(as_index(task.steps + 1),
              TrueStates{Eigen::MatrixXd(rows, model.layout.state_count())}),
      seen_{Eigen::MatrixXd(rows, model.layout.state_count())},
      costs_(rows, task.steps + 1),
      measurement_normals_(rows, model.layout.state_count()),
      d_state_(rows, model.layout.state_count()),
      d_before_(rows, model.layout.state_count()),
      d_increment_(rows, 1),
      d_mean_(rows, 1),
      d_deviation_(rows, 1),
      d_model_input_(rows, model.columns),
      d_linear_(rows, model.linear),
      d_scaled_(rows, model.features),
      d_input_(rows, model.layout.input_count()),
      d_seen_(rows, model.layout.state_count()) {
  std::vector<PosteriorTape> processes;
  for (const VelocityPosterior& p : model.posteriors) {
    processes.emplace_back(rows, model.columns, p.samples());
    scratch_.emplace_back(rows, model.columns, model.linear, p.samples());
  }
  tape_.assign(
      as_index(task.steps),
      TimeTape{Eigen::MatrixXd(rows, model.features), Eigen::MatrixXd(rows, model.features),
               Eigen::MatrixXd(rows, even(basis_count)),
               Eigen::MatrixXd(rows, model.layout.input_count()),
               Eigen::MatrixXd(rows, model.columns),
               Eigen::MatrixXd(rows, model.physics ? model.linear : 0),
               Eigen::MatrixXd(rows, model.layout.position_count()), processes});
}

ConstBlock BlockRollout::linear_of(const TimeTape& tape) const {
  if (model_.physics) return tape.linear;
  return tape.model_input;
}

void BlockRollout::draw_start(const RolloutDraws& draws, Index first) {
  Eigen::MatrixXd& x = states_.front().values;
  draw_normals({draws.seed, Use::kStart, draws.step, 0}, first, x);
  x = x * task_.start.sigma.asDiagonal();
  const Index modes = task_.start.means.rows();
  Eigen::MatrixXd mode(rows_, 1);
  draw_uniforms({draws.seed, Use::kStartMode, draws.step, 0}, first, mode);
  for (Index i = 0; i < rows_; ++i) {
    const auto m = static_cast<Index>(mode(i, 0) * static_cast<double>(modes));
    x.row(i) += task_.start.means.row(m);
  }
}

// The policy's inputs at a time, from what it sees.
void BlockRollout::act(const PreparedPolicy& policy, const RolloutDraws& draws, Index first,
                       int time) {
  TimeTape& tape = tape_[as_index(time)];
  const auto t = static_cast<std::uint32_t>(time);
  if (filter_.noisy()) {
    draw_normals({draws.seed, Use::kMeasurement, draws.step, t}, first, measurement_normals_);
  }
  filter_.step(states_[as_index(time)], measurement_normals_, seen_);
  state_features(model_.layout, seen_.values, tape.seen_features);
  tape.scaled = tape.seen_features * policy.inverse_scales.asDiagonal();
  draw_dropout({draws.seed, Use::kDropout, draws.step, t}, draws.dropout, first, tape.basis);
  policy_value(policy, tape.scaled, tape.basis, tape.input);
}

// The true state of the next time, speeds by the model and positions by integration.
void BlockRollout::advance(const RolloutDraws& draws, Index first, int time, bool with_tape) {
  TimeTape& tape = tape_[as_index(time)];
  const Eigen::MatrixXd& x = states_[as_index(time)].values;
  Eigen::MatrixXd& next = states_[as_index(time + 1)].values;
  const Index positions = model_.layout.position_count();
  const double step = model_.layout.step_s;
  state_features(model_.layout, x, tape.model_input.leftCols(model_.features));
  tape.model_input.rightCols(tape.input.cols()) = tape.input;
  if (model_.physics) model_.physics->evaluate(tape.model_input, tape.linear);
  draw_normals({draws.seed, Use::kTransition, draws.step, static_cast<std::uint32_t>(time)}, first,
               tape.normals);
  for (Index p = 0; p < positions; ++p) {
    const auto k = static_cast<std::size_t>(p);
    const VelocityPosterior& posterior = model_.posteriors[k];
    PosteriorTape& process = tape.processes[k];
    posterior.predict(tape.model_input, linear_of(tape), with_tape, process, scratch_[k]);
    for (Index i = 0; i < rows_; ++i) {
      const double increment = posterior.target_scale() *
                               (process.mean(i, 0) + process.deviation(i, 0) * tape.normals(i, p));
      next(i, positions + p) = x(i, positions + p) + increment;
      next(i, p) = x(i, p) + step * (x(i, positions + p) + 0.5 * increment);
    }
  }
}

void BlockRollout::forward(const PreparedPolicy& policy, const RolloutDraws& draws, Index first,
                           bool with_tape) {
  draw_start(draws, first);
  filter_.start();
  for (int t = 0; t < task_.steps; ++t) {
    costs_.col(t) = state_cost(task_.cost, states_[as_index(t)].values);
    act(policy, draws, first, t);
    advance(draws, first, t, with_tape);
  }
  costs_.col(task_.steps) = state_cost(task_.cost, states_[as_index(task_.steps)].values);
}

// From d_state_ at time + 1 to that at time, and d_input_.
void BlockRollout::pull_back_advance(int time) {
  TimeTape& tape = tape_[as_index(time)];
  const Index positions = model_.layout.position_count();
  const double step = model_.layout.step_s;
  d_before_.leftCols(positions) = d_state_.leftCols(positions);
  d_before_.rightCols(positions) =
      d_state_.rightCols(positions) + step * d_state_.leftCols(positions);
  d_model_input_.setZero();
  for (Index p = 0; p < positions; ++p) {
    const auto k = static_cast<std::size_t>(p);
    const VelocityPosterior& posterior = model_.posteriors[k];
    d_increment_ = d_state_.col(positions + p) + 0.5 * step * d_state_.col(p);
    d_mean_ = posterior.target_scale() * d_increment_;
    d_deviation_ = d_mean_.cwiseProduct(tape.normals.col(p));
    posterior.pullback(linear_of(tape), tape.processes[k], d_mean_, d_deviation_, scratch_[k],
                       d_model_input_, d_linear_);
    if (posterior.factors() == 0) continue;
    if (model_.physics) {
      model_.physics->pullback(tape.model_input, d_linear_, d_model_input_);
    } else {
      d_model_input_ += d_linear_;
    }
  }
  const Index features = model_.features;
  state_features_pullback(model_.layout, tape.model_input.leftCols(features),
                          d_model_input_.leftCols(features), d_before_);
  d_input_ = d_model_input_.rightCols(d_input_.cols());
}

// From d_input_ to the policy's numbers and, through what it saw, to d_before_.
void BlockRollout::pull_back_act(const PreparedPolicy& policy, int time, PolicyGradient& gradient) {
  TimeTape& tape = tape_[as_index(time)];
  policy_pullback(policy, tape.scaled, tape.basis, tape.input, d_input_, d_scaled_, gradient);
  d_scaled_ = d_scaled_ * policy.inverse_scales.asDiagonal();
  d_seen_.setZero();
  state_features_pullback(model_.layout, tape.seen_features, d_scaled_, d_seen_);
  filter_.pullback(d_seen_, time == 0, d_before_);
}

void BlockRollout::backward(const PreparedPolicy& policy, const Eigen::VectorXd& weights,
                            PolicyGradient& gradient) {
  filter_.start_pullback();
  d_state_.setZero();
  for (int t = task_.steps - 1; t >= 0; --t) {
    state_cost_pullback(task_.cost, states_[as_index(t + 1)].values, costs_.col(t + 1), weights,
                        d_state_);
    pull_back_advance(t);
    pull_back_act(policy, t, gradient);
    d_state_.swap(d_before_);
  }
}

}  // namespace kinescope::policy
