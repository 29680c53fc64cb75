// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/particle_objective.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "dynamics/gp/workers.h"
#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

// Blocks whose kernel rows stay in the second cache (1 MB for 48 rows of 300 samples with their
// tape); of the sizes the one that computes the fewest particles nobody asked for.
Index rows_of_block(int particles) {
  const auto computed = [&](Index rows) { return (particles + rows - 1) / rows * rows; };
  Index best = 48;
  for (const Index rows : {40, 32, 24, 16, 8}) {
    if (computed(rows) < computed(best)) best = rows;
  }
  return best;
}

// Workers take one of as many rollouts as there are workers: which one does not matter.
class Pool {
 public:
  void add(std::unique_ptr<BlockRollout> rollout) { free_.push_back(std::move(rollout)); }
  std::unique_ptr<BlockRollout> take() {
    const std::scoped_lock lock(mutex_);
    std::unique_ptr<BlockRollout> out = std::move(free_.back());
    free_.pop_back();
    return out;
  }
  void give_back(std::unique_ptr<BlockRollout> rollout) {
    const std::scoped_lock lock(mutex_);
    free_.push_back(std::move(rollout));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<BlockRollout>> free_;
};

void copy_rollout(const BlockRollout& block, Index first, Index rows, ParticleRollout& out) {
  for (std::size_t t = 0; t < out.states.size(); ++t) {
    const int time = static_cast<int>(t);
    out.states[t].middleRows(first, rows) = block.states(time).values.topRows(rows);
    if (t < out.inputs.size()) {
      out.inputs[t].middleRows(first, rows) = block.inputs(time).topRows(rows);
    }
  }
}

}  // namespace

struct ParticleObjective::State {
  State(const VelocityModel& velocity_model, const PolicyTask& policy_task, int count, int threads)
      : model(velocity_model),
        task(policy_task),
        particles(count),
        rows(rows_of_block(count)),
        workers(threads),
        costs(count, policy_task.steps + 1) {
    KINESCOPE_CHECK(rows > 0, "blocks of particles");
    blocks = (particles + rows - 1) / rows;
  }

  PreparedModel model;
  PolicyTask task;
  Index particles;
  Index rows;
  Index blocks = 0;
  gp::Workers workers;
  Pool pool;
  Eigen::MatrixXd costs;
  std::vector<PolicyGradient> gradients;
};

ParticleObjective::ParticleObjective(const VelocityModel& model, const PolicyTask& task,
                                     int particles, Index basis_count, int threads)
    : state_(std::make_unique<State>(model, task, particles, threads)) {
  for (int w = 0; w < state_->workers.count(); ++w) {
    state_->pool.add(
        std::make_unique<BlockRollout>(state_->model, state_->task, basis_count, state_->rows));
  }
}

ParticleObjective::~ParticleObjective() = default;

ParticleCost ParticleObjective::evaluate(const RbfPolicy& policy, const RolloutDraws& draws,
                                         PolicyGradient* gradient, ParticleRollout* rollout) {
  State& s = *state_;
  const PreparedPolicy prepared(policy);
  s.gradients.resize(gradient != nullptr ? static_cast<std::size_t>(s.blocks) : 0,
                     PolicyGradient(policy));
  s.workers.run(s.blocks, [&](Index block, gp::Scratch&) {
    std::unique_ptr<BlockRollout> run = s.pool.take();
    const Index first = block * s.rows;
    const Index rows = std::min(s.rows, s.particles - first);
    run->forward(prepared, draws, first, gradient != nullptr);
    s.costs.middleRows(first, rows) = run->costs().topRows(rows);
    if (rollout != nullptr) copy_rollout(*run, first, rows, *rollout);
    if (gradient != nullptr) {
      Eigen::VectorXd weights = Eigen::VectorXd::Zero(s.rows);
      weights.head(rows).setConstant(1.0 / static_cast<double>(s.particles));
      PolicyGradient& own = s.gradients[static_cast<std::size_t>(block)];
      own.set_zero();
      run->backward(prepared, weights, own);
    }
    s.pool.give_back(std::move(run));
  });
  if (gradient != nullptr) {
    gradient->set_zero();
    for (const PolicyGradient& part : s.gradients) gradient->add(part);
    finish_gradient(prepared, *gradient);
  }
  const Eigen::VectorXd sums = s.costs.rowwise().sum();
  ParticleCost out{sums.mean(), 0.0, s.costs.minCoeff(), s.costs.maxCoeff()};
  out.sigma = std::sqrt((sums.array() - out.cost).square().mean());
  if (rollout != nullptr) rollout->costs = s.costs;
  return out;
}

}  // namespace kinescope::policy
