// SPDX-License-Identifier: Apache-2.0
//
// Learners on a simulated UR10: exact processes of all samples, beside inducing points of the same
// kernels and hyperparameters.
#include "dynamics/experiments/ur10.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "app/experiments/comparison_summary.h"
#include "app/experiments/experiments.h"
#include "app/experiments/own_log.h"

namespace kinescope::experiments {
namespace {

struct NamedTest {
  std::string name;
  std::string words;
  std::vector<Trial> trials;
};

std::vector<Learner> ur10_learners(const ExperimentChoice& choice) {
  using enum Learner;
  return choice.learners.value_or(std::vector{kGip, kGipInducing, kRbf, kRbfInducing, kNetwork,
                                              kModelBased, kSemiParametric,
                                              kSemiParametricInducing});
}

// The search sees fewer samples than elsewhere, for an answer in minutes: of 4000 samples, gip errs
// by 1.1 and 2.0 % on the two tests with 500 as with 1000, semi_parametric by 1.1 and 0.9 % in
// place of 0.9 and 0.6 %; with 300 of 1000 samples and one start it failed at three joints.
LearnOptions ur10_learn_options(const ExperimentChoice& choice) {
  constexpr int kSearchSamples = 500;
  LearnOptions out = learn_options(choice);
  if (!choice.search_samples) out.search.samples = kSearchSamples;
  return out;
}

// The exact process's error and that of its inducing points, of all joints together.
std::vector<std::string> costs_of_inducing(const ComparisonFacts& facts, int points) {
  constexpr std::array<std::pair<Learner, Learner>, 3> kPairs = {
      {{Learner::kGip, Learner::kGipInducing},
       {Learner::kRbf, Learner::kRbfInducing},
       {Learner::kSemiParametric, Learner::kSemiParametricInducing}}};
  std::vector<std::string> out;
  for (const auto& [exact, inducing] : kPairs) {
    const double all = median_error(facts, 0, exact, -1);
    const double few = median_error(facts, 0, inducing, -1);
    if (!std::isfinite(all) || !std::isfinite(few)) continue;
    out.push_back(
        fmt::format("{} from all samples errs by {:.3g} %, through {} inducing points by "
                    "{:.3g} %, all joints together.",
                    to_string(exact), all, points, few));
  }
  return out;
}

ExperimentSection section_of(const NamedTest& test, const ComparisonFacts& facts) {
  std::string id = test.name;
  std::ranges::replace(id, ' ', '_');
  ExperimentSection out{std::move(id), "Test: " + test.name, {test.words}, {}, {}};
  out.figures = box_figures(facts, 0);
  return out;
}

// Everything that is said of the tests, whatever was learned from.
ExperimentSummary summary_of(const std::vector<NamedTest>& tests, const ComparisonPlan& plan,
                             int samples, const std::vector<std::string>& joints) {
  ExperimentSummary out;
  std::vector<std::pair<std::string, ComparisonFacts>> facts;
  for (const NamedTest& test : tests) {
    facts.emplace_back(test.name,
                       ComparisonFacts{test.trials,
                                       {"training samples", {static_cast<double>(samples)}},
                                       plan.learners,
                                       joints,
                                       plan.runs});
    const ComparisonFacts& own = facts.back().second;
    for (std::vector<std::string> sentences :
         {comparison_findings(own, 0), costs_of_inducing(own, plan.learn.inducing)}) {
      for (const std::string& words : sentences) {
        out.findings.push_back(fmt::format("On {}: {}", test.name, words));
      }
    }
    out.sections.push_back(section_of(test, own));
  }
  out.tables = comparison_tables(facts);
  out.sections.front().tables = {"medians"};
  return out;
}

std::vector<std::pair<std::string, std::string>> settings_of(const ExperimentChoice& choice,
                                                             const ComparisonPlan& plan,
                                                             int samples) {
  std::vector<std::pair<std::string, std::string>> out = learn_settings(choice, plan.learn);
  out.insert(out.begin(), {{"Runs", fmt::format("{}", plan.runs)},
                           {"Samples to learn from", fmt::format("{}", samples)},
                           {"Inducing points", fmt::format("{}", plan.learn.inducing)}});
  return out;
}

ExperimentSummary ur10_on_own_log(const ExperimentChoice& choice, const Progress& progress) {
  const auto all = static_cast<int>(choice.log->samples.size());
  const std::vector<ComparisonCase> cases =
      cases_of_log(*choice.log, choice.runs.value_or(2), choice.samples.value_or(all));
  const ComparisonPlan plan{1, static_cast<int>(cases.size()), ur10_learners(choice),
                            [&](int, int run) { return cases[static_cast<std::size_t>(run)]; },
                            ur10_learn_options(choice)};
  Eigen::Index most = 0;
  for (const ComparisonCase& one : cases) most = std::max(most, one.train.size());
  require_memory(plan.learners, choice.log->robot, cases.front().train, most);
  const NamedTest test{
      "parts left out",
      fmt::format("Parts of the log, left out one after another: {} of them.", plan.runs),
      run_comparison(plan, progress)};
  const auto samples = static_cast<int>(most);
  ExperimentSummary out = summary_of({test}, plan, samples, choice.log->joints);
  out.settings = settings_of(choice, plan, samples);
  return out;
}

std::vector<NamedTest> tests_of(const std::vector<Trial>& trials) {
  std::vector<NamedTest> out = {
      {"random points",
       "Between other random points of the joint space, at other speeds. 100 % is what a constant "
       "does.",
       {}},
      {"circle",
       "The tool on a circle in a plane that each run draws, its direction held, at a speed that "
       "comes and "
       "goes: motion unlike what was learned from, in which several joints turn round.",
       {}}};
  for (const Trial& trial : trials) {
    out[static_cast<std::size_t>(trial.trajectory)].trials.push_back(trial);
  }
  return out;
}

}  // namespace
}  // namespace kinescope::experiments

namespace kinescope {

ExperimentSummary ur10_experiment(const ExperimentChoice& choice, const Progress& progress) {
  using namespace experiments;
  if (choice.log) return ur10_on_own_log(choice, progress);
  Ur10Options world{.seed = choice.seed};
  world.samples = choice.samples.value_or(world.samples);
  // As in the paper: 25000 beside 40000.
  world.test_samples = static_cast<int>(0.625 * world.samples);
  const ComparisonPlan plan{1,
                            choice.runs.value_or(1),
                            ur10_learners(choice),
                            [&](int, int run) { return ur10_case(run, world); },
                            ur10_learn_options(choice),
                            true};
  const ComparisonCase like = ur10_case(0, {.samples = 16, .test_samples = 16});
  require_memory(plan.learners, like.believed, like.train, world.samples);
  const std::vector<NamedTest> tests = tests_of(run_comparison(plan, progress));
  ExperimentSummary out = summary_of(tests, plan, world.samples,
                                     {"joint1", "joint2", "joint3", "joint4", "joint5", "joint6"});
  out.settings = settings_of(choice, plan, world.samples);
  out.settings.insert(
      out.settings.begin() + 2,
      {{"Samples to be judged on, without noise",
        fmt::format("{}, half of them random points, half a circle", world.test_samples)},
       {"Drives", "friction and current noise as measured on a UR10e, springs as of its gears"}});
  return out;
}

}  // namespace kinescope
