// SPDX-License-Identifier: Apache-2.0
#include "app/torque/traced_score.h"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/data/splits.h"
#include "dynamics/models/constant_joints.h"
#include "kinematics/core/error.h"
#include "kinematics/core/parallel_for.h"

namespace kinescope {
namespace {

constexpr int kFolds = 4;  // each costs a fit of all parameters

/// Times of samples, ascending, by the name of their trajectory.
using Times = std::map<std::string, std::vector<double>>;

Times times_of(const TorqueSamples& samples) {
  Times out;
  for (Eigen::Index i = 0; i < samples.size(); ++i) {
    out[samples.trajectory_name(samples.trajectory[i])].push_back(samples.t_s[i]);
  }
  for (auto& [name, times] : out) std::ranges::sort(times);
  return out;
}

/// Traced samples that have one of `kept` within a sample's step: the two are filtered differently.
std::vector<char> near(const TorqueSamples& traced, const TorqueSamples& kept, double step_s) {
  const Times times = times_of(kept);
  std::vector<char> out(static_cast<std::size_t>(traced.size()), 0);
  for (Eigen::Index i = 0; i < traced.size(); ++i) {
    const auto own = times.find(traced.trajectory_name(traced.trajectory[i]));
    if (own == times.end()) continue;
    const double t = traced.t_s[i];
    const auto next = std::ranges::lower_bound(own->second, t - step_s);
    out[static_cast<std::size_t>(i)] = next != own->second.end() && *next <= t + step_s ? 1 : 0;
  }
  return out;
}

/// Rows of `all` that `part`, chosen from it in order, is made of.
std::vector<Eigen::Index> rows_of(const TorqueSamples& all, const TorqueSamples& part) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < all.size() && std::ssize(rows) < part.size(); ++i) {
    const Eigen::Index next = std::ssize(rows);
    if (all.t_s[i] == part.t_s[next] && all.trajectory[i] == part.trajectory[next]) {
      rows.push_back(i);
    }
  }
  KINESCOPE_CHECK(std::ssize(rows) == part.size(), "the part is of the log, in its order");
  return rows;
}

class TracedJudge {
 public:
  TracedJudge(const DynamicModel& model, const TracedLog& traced, const TorqueSummary& summary)
      : model_(model), traced_(traced), all_(summary.data.samples), train_(summary.train) {
    filter_ = {summary.data.filter, summary.data.cutoff.cutoff_hz};
    step_s_ = 1.0 / std::min(summary.data.rate_hz, rate_hz(traced.samples));
  }

  /// Blocks of the training samples that are left out in turn; nothing where they are too few.
  [[nodiscard]] std::optional<Folds> folds() const {
    try {
      return split_folds(train_, {.folds = kFolds});
    } catch (const Error& error) {
      if (error.code() != ExitCode::kUndetermined) throw;
      return std::nullopt;
    }
  }

  /// Torques of the whole log, for effects have a memory, by fits to each of these parts of it.
  [[nodiscard]] std::vector<Eigen::MatrixXd> of_log(const std::vector<TorqueSamples>& parts) const {
    std::vector<Eigen::MatrixXd> out(parts.size());
    parallel_for(parts.size(), [&](std::size_t k) {
      out[k] = of(refit(model_, traced_.samples, traced_.options, traced_.trace,
                        near(traced_.samples, parts[k], step_s_)),
                  all_);
    });
    return out;
  }

  [[nodiscard]] Eigen::MatrixXd of(const CorrectedTorqueModel& corrected,
                                   const TorqueSamples& samples) const {
    return predict_torque(corrected, samples, filter_);
  }

  /// `means`: of the whole log, without each fold.
  [[nodiscard]] LeftOutTorques left_out(const Folds& split,
                                        const std::vector<Eigen::MatrixXd>& means) const {
    const std::vector<Eigen::Index> in_log = rows_of(all_, train_);
    LeftOutTorques out;
    out.folds = static_cast<int>(split.folds.size());
    out.by_trajectory = split.by_trajectory;
    out.residual.resize(train_.size(), train_.joints());
    out.constant_residual = out.residual;
    out.torque = train_.torque;
    out.fold.resize(train_.size());
    for (int f = 0; f < out.folds; ++f) {
      const Fold& fold = split.folds[static_cast<std::size_t>(f)];
      const Eigen::MatrixXd& mean = means[static_cast<std::size_t>(f)];
      const Eigen::RowVectorXd constant = train_.torque(fold.train, Eigen::all).colwise().mean();
      for (const Eigen::Index row : fold.test) {
        out.residual.row(row) =
            train_.torque.row(row) - mean.row(in_log[static_cast<std::size_t>(row)]);
        out.constant_residual.row(row) = train_.torque.row(row) - constant;
        out.fold[row] = f;
      }
    }
    out.model_sigma = out.sigma = Eigen::MatrixXd::Zero(train_.size(), train_.joints());
    return out;
  }

 private:
  static double rate_hz(const TorqueSamples& samples) {
    std::vector<double> steps;
    for (Eigen::Index i = 1; i < samples.size(); ++i) {
      const double step = samples.t_s[i] - samples.t_s[i - 1];
      if (samples.trajectory[i] == samples.trajectory[i - 1]) steps.push_back(step);
    }
    if (steps.empty()) return 1.0;
    const auto middle = steps.begin() + std::ssize(steps) / 2;
    std::ranges::nth_element(steps, middle);
    return 1.0 / *middle;
  }

  const DynamicModel& model_;
  const TracedLog& traced_;
  const TorqueSamples& all_;
  const TorqueSamples& train_;
  TorqueFilter filter_;
  double step_s_ = 0.0;
};

TracedScore judged(const TracedJudge& judge, const TracedLog& traced, const TorqueSummary& summary,
                   bool unseen_test) {
  TracedScore out;
  const TorqueSamples& test = summary.test;
  TorquePrediction& prediction = out.prediction;
  const std::optional<Folds> split = judge.folds();
  std::vector<TorqueSamples> parts;
  if (split) {
    for (const Fold& fold : split->folds) parts.push_back(select_rows(summary.train, fold.train));
  }
  if (!unseen_test) parts.push_back(summary.train);
  const std::vector<Eigen::MatrixXd> means = judge.of_log(parts);
  if (unseen_test) {
    prediction.mean = judge.of(traced.trace.corrected, test);
  } else {
    prediction.mean = means.back()(rows_of(summary.data.samples, test), Eigen::all);
  }
  prediction.model_sigma = Eigen::MatrixXd::Zero(test.size(), test.joints());
  prediction.sigma = prediction.model_sigma;
  Eigen::VectorXd left_out_percent;
  if (split) {
    const LeftOutTorques left = judge.left_out(*split, means);
    const CalibratedSigma calibrated = calibrate(left);
    out.bands = calibrated.bands;
    prediction = with_sigma_parts(std::move(prediction), calibrated.parts);
    left_out_percent = left_out_nmse_percent(left);
  }
  out.score = score_prediction(prediction, out.bands, test);
  out.score.left_out_nmse_percent = left_out_percent;
  out.score.extrapolated =
      Eigen::VectorXd::Constant(test.joints(), std::numeric_limits<double>::quiet_NaN());
  return out;
}

}  // namespace

TracedScore score_traced(const DynamicModel& model, const TracedLog& traced,
                         const TorqueSummary& summary, bool unseen_test) {
  TracedScore out;
  try {
    out = judged(TracedJudge(model, traced, summary), traced, summary, unseen_test);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    out.score.failure = error.what();
  }
  out.score.traced = true;
  out.score.training_samples = static_cast<int>(summary.train.size());
  return out;
}

}  // namespace kinescope
