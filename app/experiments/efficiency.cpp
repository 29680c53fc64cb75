// SPDX-License-Identifier: Apache-2.0
//
// How much motion each learner needs: the first N samples of one trajectory.
#include <algorithm>
#include <ranges>
#include <utility>

#include <fmt/format.h>

#include "app/experiments/comparison_summary.h"
#include "app/experiments/experiments.h"
#include "app/experiments/own_log.h"
#include "dynamics/experiments/quartiles.h"
#include "dynamics/experiments/scara.h"

namespace kinescope::experiments {
namespace {

constexpr int kFewest = 125;

// Ascending, each half of the next.
std::vector<int> sizes_up_to(int most) {
  std::vector<int> out{most};
  while (out.back() / 2 >= kFewest) out.push_back(out.back() / 2);
  std::ranges::reverse(out);
  return out;
}

double inside_at(const std::vector<Trial>& trials, int setting) {
  std::vector<double> shares;
  for (const Trial& trial : trials) {
    if (trial.setting == setting) shares.push_back(trial.inside_percent);
  }
  return quartiles(std::move(shares)).median;
}

// Where the plain squared exponential is ahead of GIP, and what the test asks for there.
std::string early(const ComparisonFacts& facts) {
  std::string words;
  for (int s = 0; std::cmp_less(s, facts.axis.values.size()); ++s) {
    const double gip = median_error(facts, s, Learner::kGip, -1);
    const double rbf = median_error(facts, s, Learner::kRbf, -1);
    if (!(rbf < gip)) continue;
    words += fmt::format(
        "{}{:g} samples (rbf {:.3g} %, gip {:.3g} %; {:.0f} % of the test's postures lie within "
        "the ranges learned from)",
        words.empty() ? "" : ", ", facts.axis.values[static_cast<std::size_t>(s)], rbf, gip,
        inside_at(facts.trials, s));
  }
  if (words.empty()) return {};
  return fmt::format(
      "rbf is ahead of gip at {}. Outside of what was learned from, a squared exponential falls "
      "back to the mean torque, while a polynomial grows with the square of the velocities and the "
      "fourth power of the positions.",
      words);
}

struct Worlds {
  std::vector<ComparisonCase> all;  // whole; of a log: by time
  std::vector<std::string> joints;
  int most = 0;  // samples to learn from
};

Worlds worlds_of(const ExperimentChoice& choice) {
  Worlds out;
  out.most = choice.samples.value_or(4000);
  if (choice.log) {
    out.all = cases_of_log(*choice.log, choice.runs.value_or(10), 0);
    out.joints = choice.log->joints;
    for (const ComparisonCase& one : out.all) {
      out.most = std::min(out.most, static_cast<int>(one.train.size()));
    }
    return out;
  }
  ScaraOptions world{.seed = choice.seed};
  world.samples = world.test_samples = out.most;
  world.noise = choice.noise.value_or(world.noise);
  for (int run = 0; run < choice.runs.value_or(20); ++run) {
    out.all.push_back(scara_case({}, run, world));
  }
  out.joints = {"joint1", "joint2", "joint3", "joint4"};
  return out;
}

}  // namespace
}  // namespace kinescope::experiments

namespace kinescope {

ExperimentSummary efficiency_experiment(const ExperimentChoice& choice, const Progress& progress) {
  using namespace experiments;
  const Worlds worlds = worlds_of(choice);
  const std::vector<int> sizes = sizes_up_to(worlds.most);
  const LearnOptions learn = learn_options(choice);
  const ComparisonPlan plan{static_cast<int>(sizes.size()), static_cast<int>(worlds.all.size()),
                            chosen_learners(choice),
                            [&](int setting, int run) {
                              return first_of(worlds.all[static_cast<std::size_t>(run)],
                                              sizes[static_cast<std::size_t>(setting)]);
                            },
                            learn};
  const std::vector<Trial> trials = run_comparison(plan, progress);
  const ComparisonFacts facts{trials,
                              {"training samples", {sizes.begin(), sizes.end()}},
                              plan.learners,
                              worlds.joints,
                              plan.runs};
  ExperimentSummary out;
  out.settings = learn_settings(choice, learn);
  out.settings.insert(out.settings.begin(), {{"Runs", fmt::format("{}", plan.runs)},
                                             {"Samples", fmt::format("{}", worlds.most)}});
  out.findings = comparison_findings(facts, plan.settings - 1);
  if (std::string words = early(facts); !words.empty()) out.findings.push_back(std::move(words));
  out.tables = comparison_tables(facts);
  ExperimentSection curve{"curve", "Error over the samples learned from", {}, {"medians"}, {}};
  curve.words.emplace_back(
      "The first samples of a trajectory: what a robot has seen that has moved for so long. The "
      "geometry believed is the true one, or that of the URDF. Error of all joints together: sum "
      "of "
      "squared errors over sum of variances.");
  curve.figures.push_back(curve_figure(facts, -1));
  for (int j = 0; std::cmp_less(j, worlds.joints.size()); ++j) {
    curve.figures.push_back(curve_figure(facts, j));
  }
  out.sections.push_back(std::move(curve));
  return out;
}

}  // namespace kinescope
