// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/improve.h"

#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "dynamics/policy/adam.h"
#include "dynamics/policy/particle_objective.h"
#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

Eigen::VectorXd packed(const RowMajor& centres, const Eigen::RowVectorXd& log_scales,
                       const RowMajor& weights) {
  Eigen::VectorXd out(centres.size() + log_scales.size() + weights.size());
  out << Eigen::Map<const Eigen::VectorXd>(centres.data(), centres.size()), log_scales.transpose(),
      Eigen::Map<const Eigen::VectorXd>(weights.data(), weights.size());
  return out;
}

void check_range(bool inside, std::string_view name, double value, std::string_view remedy) {
  if (!inside) throw bad_request("search", fmt::format("{} of {}", name, value), remedy);
}

// One search: gradient steps until there is no progress.
class Search {
 public:
  Search(const VelocityModel& model, const PolicyTask& task, SearchState search,
         const ImproveOptions& options)
      : options_(options),
        search_(std::move(search)),
        objective_(model, task, options.particles, search_.policy.basis_count(), options.threads),
        gradient_(search_.policy) {}

  [[nodiscard]] SearchState& state() { return search_; }
  [[nodiscard]] double gradient_norm() const { return gradient_norm_; }

  // A step with a finite cost and gradient; false where none was found.
  bool step(const std::function<RbfPolicy(int)>& redraw) {
    for (int redraws = 0; redraws <= options_.max_resamples; ++redraws) {
      for (int k = 0; k <= options_.max_resamples; ++k) {
        if (evaluate()) return true;
        ++search_.resamples;
      }
      search_.policy = redraw(++search_.redraws);
      search_.first_moment.setZero();
      search_.second_moment.setZero();
      search_.adam_step = 0;
    }
    return false;
  }

  // Moves the policy; true where there was no progress for long enough.
  bool move() {
    Eigen::VectorXd gradient = search_gradient(gradient_, search_.policy);
    limit_gradient(options_.gradient_limit, gradient, search_);
    adam_step(gradient, search_);
    ++search_.step;
    return note_cost(cost_.cost, options_, search_);
  }

  // Of the policy as it is, all basis functions there.
  [[nodiscard]] ParticleCost final_cost() {
    constexpr auto kBeyondAllSteps = std::numeric_limits<std::uint32_t>::max();
    return objective_.evaluate(search_.policy, {search_.seed, kBeyondAllSteps, 0.0}, nullptr);
  }

 private:
  bool evaluate() {
    const auto draw = static_cast<std::uint32_t>(search_.step + search_.resamples);
    cost_ = objective_.evaluate(search_.policy, {search_.seed, draw, search_.dropout}, &gradient_);
    gradient_norm_ = gradient_.norm();
    refuse_constant_cost();
    return std::isfinite(cost_.cost) && std::isfinite(gradient_norm_);
  }

  void refuse_constant_cost() const {
    // Below this a saturated cost differs by rounding: 1 - exp(-x) of x > 23.
    constexpr double kSame = 1e-10;
    if (search_.step > 0 || !std::isfinite(cost_.cost)) return;
    if (cost_.highest - cost_.lowest > kSame && gradient_norm_ > 0.0) return;
    throw undetermined(
        "cost", fmt::format("it is {:.6g} for every particle at every time", cost_.highest),
        "give larger length scales, a target within reach, or a state that the inputs move");
  }

  const ImproveOptions& options_;
  SearchState search_;
  ParticleObjective objective_;
  PolicyGradient gradient_;
  ParticleCost cost_;
  double gradient_norm_ = 0.0;
};

}  // namespace

void check_options(const ImproveOptions& o) {
  check_range(o.particles >= 2, "a number of particles", o.particles, "give 2 or more");
  check_range(o.max_steps >= 1, "a number of steps", o.max_steps, "give 1 or more");
  check_range(o.min_learning_rate > 0.0 && std::isfinite(o.min_learning_rate),
              "a smallest step size", o.min_learning_rate, "give one above 0");
  check_range(o.learning_rate >= o.min_learning_rate && std::isfinite(o.learning_rate),
              "a step size", o.learning_rate, "give one not below the smallest");
  check_range(o.dropout >= 0.0 && o.dropout <= 0.9, "a dropout", o.dropout, "give 0 to 0.9");
  check_range(o.dropout_decrement >= 0.0, "a decrement of the dropout", o.dropout_decrement,
              "give 0 or more");
  check_range(o.change_memory >= 0.0 && o.change_memory < 1.0, "a memory of changes",
              o.change_memory, "give 0 or more, below 1");
  check_range(o.change_ratio >= 0.0, "a ratio of changes", o.change_ratio, "give 0 or more");
  check_range(o.patience >= 1, "a patience", o.patience, "give 1 or more");
  check_range(o.gradient_limit >= 0.0, "a limit of gradients", o.gradient_limit, "give 0 or more");
  check_range(o.max_resamples >= 0, "a number of resamples", o.max_resamples, "give 0 or more");
}

Eigen::VectorXd parameters_of(const RbfPolicy& policy) {
  return packed(policy.centres, policy.length_scales.array().log().matrix().transpose(),
                policy.weights * policy.input_limit.cwiseInverse().asDiagonal());
}

Eigen::VectorXd search_gradient(const PolicyGradient& gradient, const RbfPolicy& policy) {
  const Index basis = gradient.basis_count;
  return packed(gradient.centres.topRows(basis), gradient.log_scales,
                gradient.weights.topRows(basis) * policy.input_limit.asDiagonal());
}

RbfPolicy with_parameters(RbfPolicy policy, const Eigen::VectorXd& parameters) {
  const Index centres = policy.centres.size();
  const Index scales = policy.length_scales.size();
  KINESCOPE_CHECK(parameters.size() == centres + scales + policy.weights.size(),
                  "as many parameters as the policy has");
  policy.centres =
      Eigen::Map<const RowMajor>(parameters.data(), policy.centres.rows(), policy.centres.cols());
  policy.length_scales = parameters.segment(centres, scales).array().exp();
  policy.weights = Eigen::Map<const RowMajor>(parameters.data() + centres + scales,
                                              policy.weights.rows(), policy.weights.cols()) *
                   policy.input_limit.asDiagonal();
  return policy;
}

SearchState begin_search(RbfPolicy policy, const ImproveOptions& options, std::uint64_t seed) {
  SearchState out;
  const Index parameters =
      policy.centres.size() + policy.length_scales.size() + policy.weights.size();
  out.policy = std::move(policy);
  out.first_moment = Eigen::VectorXd::Zero(parameters);
  out.second_moment = Eigen::VectorXd::Zero(parameters);
  out.seed = seed;
  out.learning_rate = options.learning_rate;
  out.dropout = options.dropout;
  return out;
}

Improvement improve(const VelocityModel& model, const PolicyTask& task, SearchState begin,
                    const std::function<RbfPolicy(int redraw)>& redraw,
                    const ImproveOptions& options, const SearchHooks& hooks) {
  check_options(options);
  check_model(model);
  check_task(task, model.layout);
  check_policy(begin.policy, model.layout);
  const Index parameters = parameters_of(begin.policy).size();
  if (begin.first_moment.size() != parameters || begin.second_moment.size() != parameters) {
    throw bad_request("search", "its averages are not those of its policy", "begin it anew");
  }
  Search search(model, task, std::move(begin), options);
  SearchState& state = search.state();
  Improvement out;
  out.status = SearchStatus::kStepLimit;
  while (state.step < options.max_steps) {
    if (hooks.stop.stop_requested()) {
      out.status = SearchStatus::kStopped;
      break;
    }
    if (!search.step(redraw)) {
      out.status = SearchStatus::kFailed;
      break;
    }
    const bool converged = search.move();
    if (hooks.progress) {
      hooks.progress({state.step, options.max_steps, state.costs.back(), state.learning_rate,
                      state.dropout, search.gradient_norm()});
    }
    if (converged) {
      out.status = SearchStatus::kConverged;
      break;
    }
    if (hooks.save && hooks.save_period > 0 && state.step % hooks.save_period == 0) {
      hooks.save(state);
    }
  }
  const ParticleCost cost = search.final_cost();
  out.cost = cost.cost;
  out.cost_sigma = cost.sigma;
  out.search = std::move(state);
  return out;
}

}  // namespace kinescope::policy
