// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/comparison_runs.h"

#include <utility>

#include "dynamics/experiments/quartiles.h"
#include "dynamics/identify/prediction.h"
#include "kinematics/core/error.h"

namespace kinescope::experiments {
namespace {

// Rows of the test that are judged together.
std::vector<std::vector<Eigen::Index>> parts_of(const TorqueSamples& test, bool by_trajectory) {
  const int count = by_trajectory ? test.trajectory.maxCoeff() + 1 : 1;
  std::vector<std::vector<Eigen::Index>> out(static_cast<std::size_t>(count));
  for (Eigen::Index i = 0; i < test.size(); ++i) {
    out[by_trajectory ? static_cast<std::size_t>(test.trajectory[i]) : 0].push_back(i);
  }
  return out;
}

void judge(const Eigen::MatrixXd& torque, const Eigen::MatrixXd& predicted, Trial& trial) {
  trial.nmse_percent = normalised_error_percent(torque, predicted);
  const Eigen::RowVectorXd mean = torque.colwise().mean();
  trial.global_nmse_percent =
      100.0 * (torque - predicted).squaredNorm() / (torque.rowwise() - mean).squaredNorm();
}

Eigen::MatrixXd predicted_or_reason(Learner learner, const ComparisonCase& one,
                                    const LearnOptions& options, std::string& reason) {
  try {
    return predict_by(learner, one.believed, one.train, one.test, options);
  } catch (const Error& error) {
    reason = error.what();
    return {};
  }
}

std::vector<Trial> trials_of(Learner learner, const ComparisonCase& one,
                             const ComparisonPlan& plan) {
  std::string failure;
  const Eigen::MatrixXd predicted = predicted_or_reason(learner, one, plan.learn, failure);
  std::vector<Trial> out;
  for (const auto& rows : parts_of(one.test, plan.judge_trajectories)) {
    Trial trial;
    trial.learner = learner;
    trial.trajectory = static_cast<int>(out.size());
    trial.failure = failure;
    trial.inside_percent = inside_percent(one.train.q, one.test.q(rows, Eigen::all));
    trial.nmse_percent = Eigen::VectorXd::Constant(one.test.joints(), kNotMeasured);
    trial.global_nmse_percent = kNotMeasured;
    if (failure.empty()) {
      judge(one.test.torque(rows, Eigen::all), predicted(rows, Eigen::all), trial);
    }
    out.push_back(std::move(trial));
  }
  return out;
}

}  // namespace

std::vector<Trial> run_comparison(const ComparisonPlan& plan, const Progress& progress) {
  const int total = plan.settings * plan.runs * static_cast<int>(plan.learners.size());
  constexpr std::string_view kStage = "learning";
  std::vector<Trial> out;
  int done = 0;
  report_progress(progress, kStage, done, total);
  for (int setting = 0; setting < plan.settings; ++setting) {
    for (int run = 0; run < plan.runs; ++run) {
      const ComparisonCase one = plan.make(setting, run);
      for (const Learner learner : plan.learners) {
        for (Trial& trial : trials_of(learner, one, plan)) {
          trial.setting = setting;
          trial.run = run;
          out.push_back(std::move(trial));
        }
        report_progress(progress, kStage, ++done, total);
      }
    }
  }
  return out;
}

double inside_percent(const Eigen::MatrixXd& train, const Eigen::MatrixXd& test) {
  const Eigen::RowVectorXd lower = train.colwise().minCoeff();
  const Eigen::RowVectorXd upper = train.colwise().maxCoeff();
  Eigen::Index inside = 0;
  for (Eigen::Index i = 0; i < test.rows(); ++i) {
    const auto row = test.row(i).array();
    if ((row >= lower.array()).all() && (row <= upper.array()).all()) ++inside;
  }
  return 100.0 * static_cast<double>(inside) / static_cast<double>(test.rows());
}

}  // namespace kinescope::experiments
