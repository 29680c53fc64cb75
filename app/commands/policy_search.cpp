// SPDX-License-Identifier: Apache-2.0
#include "app/commands/policy_search.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "app/io/json_text.h"
#include "app/io/policy_system_file.h"
#include "app/torque/torque_inputs.h"
#include "dynamics/policy/systems/library.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using policy::LearnerStage;
using policy::LearnerState;
using policy::PolicyProblem;
using policy::Sensing;

constexpr const char* kState = "policy_state.json";

bool is_of_the_literature(const std::string& system) {
  const std::vector<std::string> names = policy::problem_names();
  return std::ranges::find(names, system) != names.end();
}

PolicyProblem problem_of(const PolicyCommandOptions& options) {
  if (is_of_the_literature(options.system)) {
    const Sensing sensing = options.sensing.value_or(Sensing::kFullState);
    if (options.plain && sensing == Sensing::kFullState) {
      throw bad_request("--plain", "changes nothing where speeds are measured",
                        "give --sensing positions, too");
    }
    return policy::problem_named(options.system, sensing, options.plain);
  }
  if (fs::path(options.system).extension().empty() && !fs::exists(options.system)) {
    // A misspelt name rather than a file.
    return policy::problem_named(options.system, Sensing::kFullState);
  }
  if (options.sensing || options.plain) {
    throw bad_request(options.sensing ? "--sensing" : "--plain",
                      fmt::format("is said by {} itself", options.system),
                      "write its key `sensing` there");
  }
  return read_policy_problem(options.system);
}

void set_learner(PolicyProblem& problem, const PolicyCommandOptions& options) {
  policy::LearnerOptions& learner = problem.learner;
  if (options.trials) learner.trials = *options.trials;
  learner.explorations = options.explorations;
  learner.policy.basis_count = options.basis_functions;
  learner.improve.particles = options.particles;
  learner.promise_particles = options.particles;
  learner.improve.max_steps = options.search_steps;
  learner.starts = options.starts;
  learner.start_steps = std::min(learner.start_steps, options.search_steps);
  learner.first_max_steps = std::min(learner.first_max_steps, options.search_steps);
  learner.improve.threads = options.threads;
  learner.model.threads = options.threads;
  learner.model.seed = options.seed;
  learner.model.kernel = options.kernel;
  if (options.kernel != policy::VelocityKernel::kSemiParametric) return;
  if (!problem.physics) {
    throw bad_request("--kernel",
                      fmt::format("nothing is known of the physics of {}", problem.name),
                      "take se or se_p2");
  }
  learner.model.physics = problem.physics;
}

std::string sensing_word(const PolicyProblem& problem, const PolicyCommandOptions& options) {
  if (options.plain) return "positions, plain";
  return problem.task.sensing.sensing == Sensing::kPositionsOnly ? "positions" : "full";
}

nlohmann::json fingerprint_of(const PolicyRequest& request, const PolicyCommandOptions& options) {
  const PolicyProblem& problem = request.problem;
  return {{"system", problem.name},
          {"file_sha256", request.inputs.empty() ? nlohmann::json()
                                                 : nlohmann::json(request.inputs.front().sha256)},
          {"seed", options.seed},
          {"explorations", options.explorations},
          {"particles", options.particles},
          {"basis_functions", options.basis_functions},
          {"starts", options.starts},
          {"search_steps", options.search_steps},
          {"kernel", policy::name_of(options.kernel)},
          {"sensing", sensing_word(problem, options)}};
}

std::string stage_words(const policy::LearnerProgress& progress, int trials) {
  const std::string trial = fmt::format("trial {} of {}", progress.trial, trials - 1);
  switch (progress.stage) {
    case LearnerStage::kExploring:
      return fmt::format("{}, random inputs", trial);
    case LearnerStage::kModelling:
      return fmt::format("{}, model", trial);
    case LearnerStage::kStarting:
      return fmt::format("{}, starts of the policy\tcost {:.3f}", trial, progress.search.cost);
    case LearnerStage::kSearching:
      // After the tab: what it has come to, which begins no new stage.
      return fmt::format("{}, policy\tcost {:.3f}", trial, progress.search.cost);
    case LearnerStage::kTrial:
      return fmt::format("{}, on the system", trial);
    case LearnerStage::kDone:
      break;
  }
  return {};
}

void show(const Progress& progress, const policy::LearnerProgress& learner, int trials) {
  const bool searching =
      learner.stage == LearnerStage::kSearching || learner.stage == LearnerStage::kStarting;
  report_progress(progress, stage_words(learner, trials), searching ? learner.search.step : 0,
                  searching ? learner.search.max_steps : 0);
}

// The policy whose trial cost least; of several the last.
std::size_t best_policy(const LearnerState& state) {
  std::size_t best = 0;
  for (std::size_t k = 1; k < state.records.size(); ++k) {
    if (state.records[k].paid <= state.records[best].paid) best = k;
  }
  return best;
}

std::string trial_name(std::size_t number) { return fmt::format("trial_{}.csv", number); }

}  // namespace

PolicyRequest make_policy_request(const PolicyCommandOptions& options) {
  PolicyRequest out;
  if (!is_of_the_literature(options.system) && fs::exists(options.system)) {
    out.inputs = hashed_inputs({{options.system}});
  }
  out.problem = problem_of(options);
  set_learner(out.problem, options);
  policy::check_problem(out.problem);
  out.fingerprint = fingerprint_of(out, options);
  const policy::StateLayout& layout = out.problem.system->layout();
  out.settings = {
      {"Seed", fmt::format("{}", options.seed)},
      {"Trial", fmt::format("{} steps of {:g} s", out.problem.task.steps, layout.step_s)},
      {"Particles", fmt::format("{}", options.particles)},
      {"Policy", fmt::format("{} basis functions, {} starts, at most {} gradient steps a trial",
                             options.basis_functions, options.starts, options.search_steps)},
      {"Model",
       fmt::format("one Gaussian process a speed, kernel {}", policy::name_of(options.kernel))},
      {"Measured", sensing_word(out.problem, options)}};
  return out;
}

std::vector<std::string> policy_products(int trials) {
  std::vector<std::string> out{kState, "policy.json", "velocity_model.json", "policy.html",
                               "policy_search.json"};
  for (int k = 0; k < trials; ++k) out.push_back(trial_name(static_cast<std::size_t>(k)));
  return out;
}

PolicySearch::PolicySearch(PolicyRequest request, const PolicyCommandOptions& options,
                           const OutputFolder& folder)
    : request_(std::move(request)), folder_(folder), threads_(options.threads) {
  state_.seed = options.seed;
  summary_.problem = request_.problem;
  summary_.version = program_version();
  summary_.command = options.command_line;
  summary_.inputs = request_.inputs;
  summary_.settings = request_.settings;
}

void PolicySearch::open(bool fresh) {
  std::error_code error;
  const fs::path file = folder_.file(kState);
  if (fresh) {
    for (const std::string& name : folder_.own_products()) folder_.remove(name);
    return;
  }
  if (!fs::exists(file, error)) return;
  const nlohmann::json asked = read_policy_request(file);
  for (const auto& [key, value] : request_.fingerprint.items()) {
    if (asked.value(key, nlohmann::json()) == value) continue;
    throw bad_request(file.string(), fmt::format("is of a search with another {}", key),
                      "name another folder with --output, or begin anew with --force");
  }
  PolicyStateFile saved =
      read_policy_state(file, request_.problem.system->layout(), request_.problem.physics);
  bands_ = std::move(saved.bands);
  add_trials(saved.state);
  state_ = std::move(saved.state);
}

void PolicySearch::add_trials(const LearnerState& state) {
  const auto explorations = static_cast<std::size_t>(request_.problem.learner.explorations);
  for (std::size_t k = summary_.trials.size(); k < state.trials.size(); ++k) {
    PolicyTrialSummary one{.trial = state.trials[k], .record = {}, .particles = {}};
    if (k >= explorations && k - explorations < state.records.size()) {
      one.record = state.records[k - explorations];
      one.success = policy::succeeded(request_.problem, one.trial);
    }
    if (k >= bands_.size()) {
      bands_.emplace_back();
      if (one.record && state.model) {
        const policy::ParticleRollout particles =
            policy::roll_out(*state.model, request_.problem.task, state.policies[k - explorations],
                             request_.problem.learner.promise_particles, state.seed, threads_);
        bands_.back() =
            policy::particle_band(particles, request_.problem.system->layout().position_count());
      }
    }
    one.particles = bands_[k];
    summary_.trials.push_back(std::move(one));
  }
}

void PolicySearch::write_products(const LearnerState& state) const {
  const policy::StateLayout& layout = request_.problem.system->layout();
  for (std::size_t k = 0; k < state.trials.size(); ++k) {
    folder_.write(trial_name(k), trial_csv(state.trials[k], layout, bands_[k]));
  }
  if (state.model) {
    folder_.write("velocity_model.json",
                  velocity_model_text(*state.model, summary_.version, request_.problem.name,
                                      state.model_trials));
  }
  if (!state.records.empty()) {
    const std::size_t best = best_policy(state);
    folder_.write("policy.json", policy_file_text({.version = summary_.version,
                                                   .system = request_.problem.name,
                                                   .layout = layout,
                                                   .sensing = request_.problem.task.sensing,
                                                   .policy = state.policies[best],
                                                   .trial = request_.problem.learner.explorations +
                                                            static_cast<int>(best),
                                                   .promised = state.records[best].promised,
                                                   .paid = state.records[best].paid}));
  }
  folder_.write("policy_search.json", json_text(policy_search_json(summary_)));
  folder_.write("policy.html", policy_html(summary_));
}

void PolicySearch::save(const LearnerState& state) {
  const std::size_t known = summary_.trials.size();
  add_trials(state);
  folder_.write(kState, policy_state_text({.version = summary_.version,
                                           .request = request_.fingerprint,
                                           .state = state,
                                           .bands = bands_}));
  if (summary_.trials.size() > known) write_products(state);
}

void PolicySearch::run(const Console& console) {
  const int trials = request_.problem.learner.explorations + request_.problem.learner.trials;
  policy::LearnerHooks hooks;
  hooks.progress = [&](const policy::LearnerProgress& progress) {
    show(console.progress, progress, trials);
  };
  hooks.save = [this](const LearnerState& state) { save(state); };
  state_ = policy::learn(*request_.problem.system, request_.problem.task, request_.problem.learner,
                         std::move(state_), hooks);
  add_trials(state_);
  write_products(state_);
}

}  // namespace kinescope
