// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/particles.h"

#include <cmath>

#include <fmt/format.h>

#include "dynamics/policy/particle_objective.h"
#include "kinematics/core/error.h"

namespace kinescope::policy {

void check_task(const PolicyTask& task, const StateLayout& layout) {
  check_cost(task.cost, layout);
  check_sensing(task.sensing, layout);
  const StartDistribution& start = task.start;
  if (start.means.rows() < 1 || start.means.cols() != layout.state_count() ||
      start.sigma.size() != layout.state_count()) {
    throw bad_request("start",
                      fmt::format("{} states with {} entries and {} deviations", start.means.rows(),
                                  start.means.cols(), start.sigma.size()),
                      fmt::format("give one or more states of {} entries", layout.state_count()));
  }
  if (!start.means.allFinite() || !start.sigma.allFinite() || !(start.sigma.array() >= 0.0).all()) {
    throw bad_request("start", "a number is not finite or a deviation below 0",
                      "give finite states and deviations of 0 or more");
  }
  if (task.steps < 1) {
    throw bad_request("horizon", fmt::format("{} steps", task.steps), "give 1 or more");
  }
}

double ParticleRollout::mean_cost() const { return costs.rowwise().sum().mean(); }

double ParticleRollout::cost_sigma() const {
  const Eigen::ArrayXd sums = costs.rowwise().sum();
  return std::sqrt((sums - sums.mean()).square().mean());
}

ParticleRollout roll_out(const VelocityModel& model, const PolicyTask& task,
                         const RbfPolicy& policy, int particles, std::uint64_t seed, int threads) {
  check_model(model);
  check_task(task, model.layout);
  check_policy(policy, model.layout);
  if (particles < 1) {
    throw bad_request("particles", fmt::format("{} particles", particles), "give 1 or more");
  }
  ParticleRollout out;
  const auto steps = static_cast<std::size_t>(task.steps);
  out.states.assign(steps + 1, Eigen::MatrixXd(particles, model.layout.state_count()));
  out.inputs.assign(steps, Eigen::MatrixXd(particles, model.layout.input_count()));
  ParticleObjective objective(model, task, particles, policy.basis_count(), threads);
  static_cast<void>(objective.evaluate(policy, {.seed = seed}, nullptr, &out));
  return out;
}

}  // namespace kinescope::policy
