// SPDX-License-Identifier: Apache-2.0
//
// The LIP paper's comparison: learners over the number of joints.
#include "dynamics/experiments/panda.h"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "app/experiments/comparison_summary.h"
#include "app/experiments/experiments.h"
#include "app/experiments/own_log.h"

namespace kinescope::experiments {
namespace {

// Errors of joints that an arm does not have are not known: every trial has as many columns.
std::vector<Trial> padded(std::vector<Trial> trials, Eigen::Index joints) {
  for (Trial& trial : trials) {
    Eigen::VectorXd all =
        Eigen::VectorXd::Constant(joints, std::numeric_limits<double>::quiet_NaN());
    all.head(trial.nmse_percent.size()) = trial.nmse_percent;
    trial.nmse_percent = std::move(all);
  }
  return trials;
}

std::vector<std::string> names_of(int joints) {
  std::vector<std::string> out;
  for (int j = 1; j <= joints; ++j) out.push_back(fmt::format("joint{}", j));
  return out;
}

}  // namespace
}  // namespace kinescope::experiments

namespace kinescope {

ExperimentSummary panda_experiment(const ExperimentChoice& choice, const Progress& progress) {
  using namespace experiments;
  const std::vector<int> joints = choice.joints.value_or(std::vector{3, 4, 5, 6, 7});
  const int most = std::ranges::max(joints);
  const LearnOptions learn = learn_options(choice);
  const ComparisonPlan plan{
      static_cast<int>(joints.size()), choice.runs.value_or(10),
      choice.learners.value_or(
          std::vector{Learner::kGip, Learner::kRbf, Learner::kLip, Learner::kParametric}),
      [&](int setting, int run) {
        return panda_case(joints[static_cast<std::size_t>(setting)], run, choice.seed);
      },
      learn};
  const std::vector<Trial> trials = padded(run_comparison(plan, progress), most);
  const ComparisonFacts facts{trials,
                              {"joints of the arm", {joints.begin(), joints.end()}},
                              plan.learners,
                              names_of(most),
                              plan.runs};
  const int last = plan.settings - 1;
  ExperimentSummary out;
  out.settings = learn_settings(choice, learn);
  out.settings.insert(out.settings.begin(),
                      {{"Pairs of trajectories", fmt::format("{}", plan.runs)},
                       {"Samples to learn from, and to be judged on", "500"},
                       {"Noise", fmt::format("{:g} N m", kPandaNoise_nm)}});
  out.findings = comparison_findings(facts, last);
  out.findings.emplace_back(
      "Published for seven joints, on another pair of such trajectories, by the authors' code: gip "
      "1.34 0.71 0.37 9.3 3.2 13.9 11.8 %, rbf 8.3 1.7 2.7 13.8 6.2 24.7 10.6 %; lip below 10 % "
      "at every joint.");
  out.tables = comparison_tables(facts);
  ExperimentSection all{"joints", fmt::format("Joints of an arm of {}", joints.back()), {}, {}, {}};
  all.words.emplace_back(
      "500 samples of harmonics of 0.02 rad/s to learn from, 500 of another trajectory to be "
      "judged "
      "on. gip and rbf know no geometry, nor does lip, which learns all joints as the derivatives "
      "of one Lagrangian; parametric knows the kinematics.");
  all.figures = box_figures(facts, last);
  out.sections.push_back(std::move(all));
  ExperimentSection over{"number", "Error over the number of joints", {}, {"medians"}, {}};
  if (plan.settings > 1) over.figures.push_back(curve_figure(facts, -1));
  out.sections.push_back(std::move(over));
  return out;
}

}  // namespace kinescope
