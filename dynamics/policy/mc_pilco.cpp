// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/mc_pilco.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "dynamics/policy/draws.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

// Seeds of the parts of one run.
std::uint64_t seed_of(std::uint64_t seed, std::string_view part, std::size_t number) {
  return stable_hash(fmt::format("{} {} {}", part, number, seed));
}

Controller random_inputs(const StateLayout& layout, int hold, std::uint64_t seed) {
  return [rng = Rng(seed), layout, hold, value = Eigen::VectorXd()](const Eigen::VectorXd&,
                                                                    int step) mutable {
    if (value.size() == 0 || step % hold == 0) {
      value.resize(layout.input_count());
      for (double& u : value) u = rng.uniform(-1.0, 1.0);
      value = value.cwiseProduct(layout.input_limit);
    }
    return value;
  };
}

Eigen::MatrixXd states_seen(const std::vector<Trial>& trials) {
  Index rows = 0;
  for (const Trial& trial : trials) rows += trial.seen.rows();
  Eigen::MatrixXd out(rows, trials.front().seen.cols());
  Index at = 0;
  for (const Trial& trial : trials) {
    out.middleRows(at, trial.seen.rows()) = trial.seen;
    at += trial.seen.rows();
  }
  return out;
}

void check_trial(const StateLayout& layout, const Trial& trial, int steps, std::size_t number) {
  const bool fits = trial.seen.rows() == steps + 1 && trial.seen.cols() == layout.state_count() &&
                    trial.inputs.rows() == steps && trial.inputs.cols() == layout.input_count();
  if (fits && trial.seen.allFinite()) return;
  throw bad_request(fmt::format("trial {}", number),
                    fmt::format("{} x {} states that are all finite and {} x {} inputs were "
                                "expected",
                                steps + 1, layout.state_count(), steps, layout.input_count()),
                    "let the system report all of its states at every step");
}

void check_state(const System& system, const LearnerState& state, const PolicyTask& task,
                 const LearnerOptions& options) {
  for (std::size_t k = 0; k < state.trials.size(); ++k) {
    check_trial(system.layout(), state.trials[k], task.steps, k);
  }
  const std::size_t explorations =
      std::min(state.trials.size(), static_cast<std::size_t>(options.explorations));
  const bool fits = state.records.size() == state.trials.size() - explorations &&
                    state.policies.size() == state.records.size() &&
                    state.starts.size() <= static_cast<std::size_t>(options.starts) &&
                    state.model_trials <= static_cast<int>(state.trials.size()) &&
                    (!state.model || state.model->layout.positions == system.layout().positions);
  if (fits) return;
  throw bad_request("saved state",
                    fmt::format("{} trials, {} records and a model of {} trials do not fit {} "
                                "explorations of this system",
                                state.trials.size(), state.records.size(), state.model_trials,
                                options.explorations),
                    "go on with the options that it was begun with, or begin anew");
}

// One run of learn().
class Learner {
 public:
  Learner(const System& system, const PolicyTask& task, const LearnerOptions& options,
          LearnerState state, const LearnerHooks& hooks)
      : system_(system), task_(task), options_(options), state_(std::move(state)), hooks_(hooks) {}

  LearnerState run() {
    const auto explorations = static_cast<std::size_t>(options_.explorations);
    const auto all = explorations + static_cast<std::size_t>(options_.trials);
    while (state_.trials.size() < all && !hooks_.stop.stop_requested()) {
      if (state_.trials.size() < explorations) {
        explore();
        continue;
      }
      model();
      const Improvement found = search();
      if (found.status == SearchStatus::kStopped) break;
      try_out(found);
    }
    if (state_.trials.size() >= all) report(LearnerStage::kDone);
    return std::move(state_);
  }

 private:
  [[nodiscard]] int trial_number() const { return static_cast<int>(state_.trials.size()); }

  void report(LearnerStage stage, const SearchProgress& search = {}) const {
    if (hooks_.progress) hooks_.progress({stage, trial_number(), search});
  }
  void save() const {
    if (hooks_.save) hooks_.save(state_);
  }

  Trial run_trial(const Controller& controller) const {
    Trial out = system_.run(controller, task_.steps, state_.seed, trial_number());
    check_trial(system_.layout(), out, task_.steps, state_.trials.size());
    return out;
  }

  void explore() {
    report(LearnerStage::kExploring);
    const std::uint64_t seed = seed_of(state_.seed, "exploration", state_.trials.size());
    state_.trials.push_back(
        run_trial(random_inputs(system_.layout(), options_.exploration_hold, seed)));
    save();
  }

  void model() {
    if (state_.model && state_.model_trials == trial_number()) return;
    report(LearnerStage::kModelling);
    ModelOptions model = options_.model;
    model.seed = seed_of(state_.seed, "model", state_.trials.size());
    state_.model = learn_model(system_.layout(), state_.trials, model,
                               state_.model ? &*state_.model : nullptr);
    state_.model_trials = trial_number();
    state_.starts.clear();
    state_.search.reset();
    save();
  }

  [[nodiscard]] RbfPolicy new_policy(int number) const {
    const std::uint64_t seed =
        seed_of(state_.seed, fmt::format("policy {}", number), state_.trials.size());
    return draw_policy(system_.layout(), options_.policy, states_seen(state_.trials), seed);
  }

  // A start of the search, the policy of the trial before first.
  [[nodiscard]] SearchState new_start(std::size_t number) const {
    const bool keep = options_.keep_policy && !state_.policies.empty() && number == 0;
    return begin_search(
        keep ? state_.policies.back() : new_policy(static_cast<int>(number)), options_.improve,
        seed_of(state_.seed, fmt::format("search {}", number), state_.trials.size()));
  }

  // Goes on with state_.search up to a number of steps.
  Improvement go_on(LearnerStage stage, int max_steps) {
    ImproveOptions options = options_.improve;
    options.max_steps = max_steps;
    SearchHooks hooks;
    hooks.stop = hooks_.stop;
    hooks.save_period = hooks_.save_period;
    hooks.progress = [&](const SearchProgress& p) { report(stage, p); };
    hooks.save = [&](const SearchState& s) {
      state_.search = s;
      save();
    };
    const auto redraw = [&](int number) {
      return new_policy(static_cast<int>(state_.starts.size()) + options_.starts * number);
    };
    Improvement out =
        improve(*state_.model, task_, std::move(value_of(state_.search)), redraw, options, hooks);
    state_.search = out.search;
    return out;
  }

  // False where it was stopped.
  bool run_starts() {
    const auto count = static_cast<std::size_t>(options_.starts);
    while (state_.starts.size() < count) {
      if (!state_.search) state_.search = new_start(state_.starts.size());
      const Improvement found = go_on(LearnerStage::kStarting, options_.start_steps);
      if (found.status == SearchStatus::kStopped) return false;
      state_.starts.push_back(value_of(state_.search));
      state_.search.reset();
    }
    if (!state_.search) state_.search = *std::ranges::min_element(state_.starts, {}, recent_cost);
    return true;
  }

  // Mean over the last steps; a start that failed has none.
  static double recent_cost(const SearchState& search) {
    constexpr std::size_t kSteps = 20;
    if (search.costs.empty()) return std::numeric_limits<double>::infinity();
    const std::size_t count = std::min(kSteps, search.costs.size());
    return std::accumulate(search.costs.end() - static_cast<std::ptrdiff_t>(count),
                           search.costs.end(), 0.0) /
           static_cast<double>(count);
  }

  Improvement search() {
    if (!run_starts()) return {{}, SearchStatus::kStopped};
    const bool first = state_.records.empty();
    Improvement out = go_on(LearnerStage::kSearching,
                            first ? options_.first_max_steps : options_.improve.max_steps);
    if (out.status == SearchStatus::kFailed) {
      throw undetermined("search", "the cost of the particles is not finite, whatever the policy",
                         "choose the squared-exponential kernel, or explore for longer");
    }
    return out;
  }

  void try_out(const Improvement& found) {
    report(LearnerStage::kTrial);
    const RbfPolicy& policy = found.search.policy;
    const ParticleRollout promise =
        roll_out(*state_.model, task_, policy, options_.promise_particles,
                 seed_of(state_.seed, "promise", state_.trials.size()), options_.improve.threads);
    Trial trial = run_trial(controller_of(policy, system_.layout()));
    TrialRecord record;
    record.promised = promise.mean_cost();
    record.promised_sigma = promise.cost_sigma();
    record.paid = rollout_cost(task_.cost, trial.seen);
    if (trial.truth.size() > 0) record.paid_truth = rollout_cost(task_.cost, trial.truth);
    record.search_steps = found.search.step;
    record.search = found.status;
    for (const VelocityProcess& p : state_.model->processes) {
      record.samples.push_back(p.inputs.rows());
    }
    state_.policies.push_back(policy);
    state_.records.push_back(std::move(record));
    state_.trials.push_back(std::move(trial));
    state_.starts.clear();
    state_.search.reset();
    save();
  }

  const System& system_;
  const PolicyTask& task_;
  const LearnerOptions& options_;
  LearnerState state_;
  const LearnerHooks& hooks_;
};

}  // namespace

void check_learner(const System& system, const PolicyTask& task, const LearnerOptions& options) {
  check_layout(system.layout());
  check_task(task, system.layout());
  check_options(options.improve);
  for (const int count :
       {options.explorations, options.trials, options.first_max_steps, options.promise_particles,
        options.exploration_hold, options.starts, options.start_steps}) {
    if (count < 1) {
      throw bad_request("learner", fmt::format("a number of {}", count),
                        "explorations, trials, steps, particles and hold are 1 or more");
    }
  }
}

LearnerState learn(const System& system, const PolicyTask& task, const LearnerOptions& options,
                   LearnerState state, const LearnerHooks& hooks) {
  check_learner(system, task, options);
  check_state(system, state, task, options);
  return Learner(system, task, options, std::move(state), hooks).run();
}

double rollout_cost(const SaturatingCost& cost, const Eigen::MatrixXd& states) {
  return state_cost(cost, states).sum();
}

}  // namespace kinescope::policy
