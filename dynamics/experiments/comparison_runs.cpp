// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/comparison_runs.h"

#include <utility>

#include "dynamics/experiments/quartiles.h"
#include "dynamics/identify/prediction.h"
#include "kinematics/core/error.h"

namespace kinescope::experiments {
namespace {

void judge(const ComparisonCase& one, const Eigen::MatrixXd& predicted, Trial& trial) {
  const Eigen::MatrixXd& torque = one.test.torque;
  trial.nmse_percent = normalised_error_percent(torque, predicted);
  const Eigen::RowVectorXd mean = torque.colwise().mean();
  trial.global_nmse_percent =
      100.0 * (torque - predicted).squaredNorm() / (torque.rowwise() - mean).squaredNorm();
}

Trial trial_of(Learner learner, const ComparisonCase& one, const LearnOptions& options) {
  Trial trial;
  trial.learner = learner;
  trial.inside_percent = inside_percent(one.train.q, one.test.q);
  try {
    judge(one, predict_by(learner, one.believed, one.train, one.test, options), trial);
  } catch (const Error& error) {
    trial.nmse_percent = Eigen::VectorXd::Constant(one.test.joints(), kNotMeasured);
    trial.global_nmse_percent = kNotMeasured;
    trial.failure = error.what();
  }
  return trial;
}

}  // namespace

std::vector<Trial> run_comparison(const ComparisonPlan& plan, const Progress& progress) {
  const int total = plan.settings * plan.runs * static_cast<int>(plan.learners.size());
  constexpr std::string_view kStage = "learning";
  std::vector<Trial> out;
  report_progress(progress, kStage, 0, total);
  for (int setting = 0; setting < plan.settings; ++setting) {
    for (int run = 0; run < plan.runs; ++run) {
      const ComparisonCase one = plan.make(setting, run);
      for (const Learner learner : plan.learners) {
        Trial trial = trial_of(learner, one, plan.learn);
        trial.setting = setting;
        trial.run = run;
        out.push_back(std::move(trial));
        report_progress(progress, kStage, static_cast<int>(out.size()), total);
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
