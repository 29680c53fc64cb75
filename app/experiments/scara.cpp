// SPDX-License-Identifier: Apache-2.0
//
// Learners that know no geometry beside those that believe a data sheet which the arm is off from,
// more and more.
#include "dynamics/experiments/scara.h"

#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "app/experiments/comparison_summary.h"
#include "app/experiments/experiments.h"
#include "app/experiments/own_log.h"
#include "kinematics/core/error.h"

namespace kinescope::experiments {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

struct Sizes {
  std::vector<double> tilts_deg;
  std::vector<Misplacement> places;
};

Sizes sizes_of(const ExperimentChoice& choice) {
  Sizes out;
  out.tilts_deg = choice.tilts_deg.value_or(std::vector{0.5, 1.0, 2.0, 4.0, 8.0});
  const std::vector<double> shifts_m =
      choice.shifts_m.value_or(std::vector{0.002, 0.005, 0.01, 0.025, 0.05});
  if (shifts_m.size() != out.tilts_deg.size()) {
    throw bad_request(
        "--shift",
        fmt::format("{} of them, and {} of --tilt", shifts_m.size(), out.tilts_deg.size()),
        "give as many of the one as of the other");
  }
  for (std::size_t k = 0; k < shifts_m.size(); ++k) {
    out.places.push_back({out.tilts_deg[k] * kDegree, shifts_m[k]});
  }
  return out;
}

std::string sizes_text(const Sizes& sizes) {
  std::string out;
  for (std::size_t k = 0; k < sizes.places.size(); ++k) {
    out += fmt::format("{}{:g} deg and {:g} mm", k > 0 ? ", " : "", sizes.tilts_deg[k],
                       1e3 * sizes.places[k].shift_m);
  }
  return out;
}

// Where a learner that believes the sheet falls behind the one that knows no geometry.
std::vector<std::string> crossings(const ComparisonFacts& facts) {
  std::vector<std::string> out;
  for (const Learner learner :
       {Learner::kParametric, Learner::kModelBased, Learner::kSemiParametric}) {
    std::string words;
    for (std::size_t s = 0; s < facts.axis.values.size(); ++s) {
      const double own = median_error(facts, static_cast<int>(s), learner, -1);
      const double gip = median_error(facts, static_cast<int>(s), Learner::kGip, -1);
      if (!(own > gip)) continue;
      words += fmt::format("{}{:g} deg ({:.3g} against {:.3g} %)", words.empty() ? "" : ", ",
                           facts.axis.values[s], own, gip);
    }
    if (words.empty()) continue;
    out.push_back(
        fmt::format("{}, which believes the data sheet, is behind gip over all joints "
                    "at {}.",
                    to_string(learner), words));
  }
  return out;
}

ExperimentSection at_one_size(const ComparisonFacts& facts, int setting, std::string title) {
  ExperimentSection out{"joints", std::move(title), {}, {}, box_figures(facts, setting)};
  out.words.emplace_back(
      "Normalised mean squared error: mean square of the error over the variance of the torque, on "
      "a trajectory that was not learned from. 100 % is what a constant does.");
  return out;
}

ExperimentSummary on_own_log(const ExperimentChoice& choice, const Progress& progress) {
  const LearnOptions learn = learn_options(choice);
  const int samples = choice.samples.value_or(2000);
  std::vector<ComparisonCase> cases = cases_of_log(*choice.log, choice.runs.value_or(10), samples);
  const int runs = static_cast<int>(cases.size());
  const ComparisonPlan plan{1, runs, chosen_learners(choice),
                            [&](int, int run) { return cases[static_cast<std::size_t>(run)]; },
                            learn};
  const std::vector<Trial> trials = run_comparison(plan, progress);
  const ComparisonFacts facts{trials,
                              {"training samples", {static_cast<double>(samples)}},
                              plan.learners,
                              choice.log->joints,
                              runs};
  ExperimentSummary out;
  out.settings = learn_settings(choice, learn);
  out.findings = comparison_findings(facts, 0);
  out.tables = comparison_tables(facts);
  out.sections.push_back(at_one_size(
      facts, 0, fmt::format("Parts of the log left out one after another, {} of them", runs)));
  out.sections.back().tables = {"medians"};
  return out;
}

}  // namespace
}  // namespace kinescope::experiments

namespace kinescope {

ExperimentSummary scara_experiment(const ExperimentChoice& choice, const Progress& progress) {
  using namespace experiments;
  if (choice.log) return on_own_log(choice, progress);
  ScaraOptions world{.seed = choice.seed};
  world.samples = world.test_samples = choice.samples.value_or(world.samples);
  world.noise = choice.noise.value_or(world.noise);
  const Sizes sizes = sizes_of(choice);
  const LearnOptions learn = learn_options(choice);
  const ComparisonPlan plan{
      static_cast<int>(sizes.places.size()), choice.runs.value_or(20), chosen_learners(choice),
      [&](int setting, int run) {
        return scara_case(sizes.places[static_cast<std::size_t>(setting)], run, world);
      },
      learn};
  const std::vector<Trial> trials = run_comparison(plan, progress);
  const ComparisonFacts facts{trials,
                              {"tilt (deg)", sizes.tilts_deg},
                              plan.learners,
                              {"joint1", "joint2", "joint3", "joint4"},
                              plan.runs};
  const int middle = (plan.settings - 1) / 2;
  ExperimentSummary out;
  out.settings = learn_settings(choice, learn);
  out.settings.insert(
      out.settings.begin(),
      {{"Runs", fmt::format("{}", plan.runs)},
       {"Samples to learn from, and to be judged on", fmt::format("{}", world.samples)},
       {"Noise", fmt::format("{:g} % of the spread of each torque", 100.0 * world.noise)},
       {"Misplacement, standard deviation", sizes_text(sizes)}});
  out.findings = comparison_findings(facts, middle);
  for (std::string& words : crossings(facts)) out.findings.push_back(std::move(words));
  out.tables = comparison_tables(facts);
  out.sections.push_back(at_one_size(
      facts, middle,
      fmt::format("Joints at {:g} deg", sizes.tilts_deg[static_cast<std::size_t>(middle)])));
  ExperimentSection sweep{"sweep", "Error over the size of the misplacement", {}, {"medians"}, {}};
  sweep.words.emplace_back(
      "Every joint of the arm is tilted and moved from where its data sheet has it; parametric, "
      "model_based and semi_parametric believe the sheet, gip, rbf and network know none. The arm "
      "moves, not the sheet: base parameters of a sheet whose axes are not quite parallel would "
      "absorb it as other masses, but gravity about an axis that leans has no term in a sheet "
      "where the axis is vertical.");
  for (int j = 0; j < 4; ++j) sweep.figures.push_back(curve_figure(facts, j));
  if (plan.settings < 2) sweep.figures.clear();
  out.sections.push_back(std::move(sweep));
  return out;
}

}  // namespace kinescope
