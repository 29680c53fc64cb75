// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/comparison.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/data/splits.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kOfConstant = 100.0;  // nMSE, %

/// Share of the errors within `width(joint)` sigmas.
template <typename Width>
Eigen::VectorXd coverage(const Eigen::MatrixXd& error, const Eigen::MatrixXd& sigma, Width width) {
  Eigen::VectorXd out(error.cols());
  for (Eigen::Index j = 0; j < error.cols(); ++j) {
    const auto held = (error.col(j).array().abs() <= width(j) * sigma.col(j).array()).count();
    out[j] = static_cast<double>(held) / static_cast<double>(error.rows());
  }
  return out;
}

// NaN where none is.
double mean_of_finite(const Eigen::VectorXd& values) {
  double sum = 0.0;
  double count = 0.0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    sum += value;
    count += 1.0;
  }
  return count > 0.0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

Eigen::VectorXd share_beyond(const Eigen::MatrixXd& model_sigma, const BandFactors& bands) {
  const Eigen::Index joints = model_sigma.cols();
  Eigen::VectorXd out = Eigen::VectorXd::Constant(joints, std::numeric_limits<double>::quiet_NaN());
  for (Eigen::Index j = 0; j < bands.seen_sigma.size(); ++j) {
    constexpr double kRounding = 1.0 + 1e-9;  // a sigma that is the same everywhere
    const auto beyond = (model_sigma.col(j).array() > kRounding * bands.seen_sigma[j]).count();
    out[j] = static_cast<double>(beyond) / static_cast<double>(model_sigma.rows());
  }
  return out;
}

}  // namespace

TorqueScore score_prediction(const TorquePrediction& prediction, const BandFactors& bands,
                             const TorqueSamples& test) {
  const Eigen::MatrixXd error = test.torque - prediction.mean;
  TorqueScore score;
  score.test_samples = static_cast<int>(test.size());
  score.nmse_percent = normalised_error_percent(test.torque, prediction.mean);
  score.rms = error.colwise().squaredNorm().transpose() / static_cast<double>(test.size());
  score.rms = score.rms.cwiseSqrt();
  score.coverage_90 =
      coverage(error, prediction.sigma, [&](Eigen::Index j) { return bands.width_90(j); });
  score.coverage_95 =
      coverage(error, prediction.sigma, [&](Eigen::Index j) { return bands.width_95(j); });
  score.band_residuals =
      bands.residuals.size() > 0 ? bands.residuals : Eigen::VectorXi::Zero(error.cols());
  score.bands_by_trajectory = bands.by_trajectory;
  return score;
}

TorqueScore score_torque_model(const FittedTorqueModel& fitted, const TorqueSamples& test) {
  const TorquePrediction claim = fitted.claim ? fitted.claim(test.q, test.dq, test.ddq)
                                              : fitted.predict(test.q, test.dq, test.ddq);
  TorqueScore score = score_prediction(fitted.claim ? with_sigma_parts(claim, fitted.parts) : claim,
                                       fitted.bands, test);
  score.kind = fitted.kind;
  score.training_samples = fitted.samples;
  score.extrapolated = share_beyond(claim.model_sigma, fitted.bands);
  score.plainer_joints = fitted.plainer_joints;
  score.constant_joints = fitted.constant_joints;
  score.inducing_points = fitted.inducing_points;
  score.left_out_nmse_percent = fitted.left_out_nmse_percent;
  return score;
}

std::string_view name_of(const TorqueScore& score) {
  return score.traced ? "traced" : to_string(score.kind);
}

std::vector<int> worse_than_constant(const TorqueScore& score) {
  std::vector<int> out;
  for (Eigen::Index j = 0; j < score.nmse_percent.size(); ++j) {
    const auto joint = static_cast<int>(j);
    if (std::ranges::count(score.constant_joints, joint) > 0) continue;
    if (score.nmse_percent[j] > kOfConstant) out.push_back(joint);
  }
  return out;
}

int best_score(const std::vector<TorqueScore>& scores) {
  int best = -1;
  bool best_holds = false;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < scores.size(); ++k) {
    if (!scores[k].failure.empty()) continue;
    const Eigen::VectorXd& left_out = scores[k].left_out_nmse_percent;
    const bool holds = !(left_out.array() > kOfConstant).any();
    const double error = mean_of_finite(left_out);
    if (best >= 0 && (best_holds != holds ? best_holds : !(error < least))) continue;
    best = static_cast<int>(k);
    best_holds = holds;
    least = std::isnan(error) ? std::numeric_limits<double>::infinity() : error;
  }
  return std::max(best, 0);
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
  TorqueModelOptions without_bands = options;
  without_bands.band_folds = 0;
  const Eigen::RowVectorXd mean = test.torque.colwise().mean();
  const double variance = (test.torque.rowwise() - mean).squaredNorm();
  for (const int size : sizes) {
    const TorqueSamples part = select_rows(train, evenly_chosen(train.size(), size));
    const FittedTorqueModel fitted = fit_torque_model(kind, model, part, without_bands);
    const Eigen::MatrixXd error = test.torque - fitted.predict(test.q, test.dq, test.ddq).mean;
    curve.push_back({fitted.samples, 100.0 * error.squaredNorm() / variance});
  }
  return curve;
}

}  // namespace kinescope
