// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/comparison.h"

#include "dynamics/data/splits.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// Two-sided quantiles of the normal distribution.
constexpr double kNormal90 = 1.6448536;
constexpr double kNormal95 = 1.9599640;

Eigen::VectorXd coverage(const Eigen::MatrixXd& error, const Eigen::MatrixXd& sigma,
                         double quantile) {
  const auto held = (error.array().abs() <= quantile * sigma.array()).cast<double>();
  return held.colwise().mean();
}

}  // namespace

TorqueScore score_torque_model(const FittedTorqueModel& fitted, const TorqueSamples& test) {
  const TorquePrediction prediction = fitted.predict(test.q, test.dq, test.ddq);
  const Eigen::MatrixXd error = test.torque - prediction.mean;
  TorqueScore score;
  score.kind = fitted.kind;
  score.training_samples = fitted.samples;
  score.test_samples = static_cast<int>(test.size());
  score.nmse_percent = normalised_error_percent(test.torque, prediction.mean);
  score.rms = error.colwise().squaredNorm().transpose() / static_cast<double>(test.size());
  score.rms = score.rms.cwiseSqrt();
  score.coverage_90 = coverage(error, prediction.sigma, kNormal90);
  score.coverage_95 = coverage(error, prediction.sigma, kNormal95);
  return score;
}

std::vector<TorqueScore> compare_torque_models(const std::vector<TorqueModelKind>& kinds,
                                               const DynamicModel& model,
                                               const TorqueSamples& train,
                                               const TorqueSamples& test,
                                               const TorqueModelOptions& options) {
  std::vector<TorqueScore> scores;
  for (const TorqueModelKind kind : kinds) {
    try {
      scores.push_back(score_torque_model(fit_torque_model(kind, model, train, options), test));
    } catch (const Error& error) {
      TorqueScore none;
      none.kind = kind;
      none.failure = error.what();
      scores.push_back(std::move(none));
    }
  }
  return scores;
}

std::vector<LearningPoint> learning_curve(TorqueModelKind kind, const DynamicModel& model,
                                          const TorqueSamples& train, const TorqueSamples& test,
                                          const std::vector<int>& sizes,
                                          const TorqueModelOptions& options) {
  std::vector<LearningPoint> curve;
  const Eigen::RowVectorXd mean = test.torque.colwise().mean();
  const double variance = (test.torque.rowwise() - mean).squaredNorm();
  for (const int size : sizes) {
    const TorqueSamples part = select_rows(train, evenly_chosen(train.size(), size));
    const FittedTorqueModel fitted = fit_torque_model(kind, model, part, options);
    const Eigen::MatrixXd error = test.torque - fitted.predict(test.q, test.dq, test.ddq).mean;
    curve.push_back({fitted.samples, 100.0 * error.squaredNorm() / variance});
  }
  return curve;
}

}  // namespace kinescope
