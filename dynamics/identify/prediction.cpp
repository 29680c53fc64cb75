// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/prediction.h"

#include <cmath>
#include <limits>

#include "dynamics/identify/term_size.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

std::vector<TorqueTerm> kept_terms(const Identification& identification) {
  std::vector<TorqueTerm> kept;
  for (const int k : identification.basis.kept) {
    kept.push_back(identification.terms[static_cast<std::size_t>(k)]);
  }
  return kept;
}

std::vector<Eigen::MatrixXd> kept_columns(const Identification& identification,
                                          const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                          const Eigen::MatrixXd& ddq) {
  return term_columns(identification.rigid, identification.drives, kept_terms(identification), q,
                      dq, ddq);
}

/// Of each parameter: size of its column from which it acts; 0 where it does not matter.
Eigen::VectorXd acting_sizes(const Identification& identification) {
  if (identification.undetermined.empty()) {
    return Eigen::VectorXd::Zero(identification.parameters.size());
  }
  return identify::kAtRest * identify::usual_sizes(identification.rigid, identification.drives,
                                                   kept_terms(identification));
}

/// diag(W covariance W'), infinite where an undetermined parameter acts.
Eigen::ArrayXd model_variance(const Identification& identification, const Eigen::MatrixXd& W,
                              const Eigen::VectorXd& acting) {
  Eigen::MatrixXd covariance = identification.covariance;
  for (const int k : identification.undetermined) covariance(k, k) = 0.0;
  Eigen::ArrayXd variance = (W * covariance).cwiseProduct(W).rowwise().sum().array();
  for (const int k : identification.undetermined) {
    variance = (W.col(k).array().abs() > acting[k])
                   .select(std::numeric_limits<double>::infinity(), variance);
  }
  return variance.max(0.0);
}

}  // namespace

TorquePrediction predict_torque(const Identification& identification, const Eigen::MatrixXd& q,
                                const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq) {
  const std::vector<Eigen::MatrixXd> W = kept_columns(identification, q, dq, ddq);
  const auto joints = static_cast<Eigen::Index>(W.size());
  TorquePrediction out{.mean = Eigen::MatrixXd(q.rows(), joints),
                       .model_sigma = Eigen::MatrixXd(q.rows(), joints),
                       .sigma = Eigen::MatrixXd(q.rows(), joints)};
  const Eigen::VectorXd acting = acting_sizes(identification);
  for (Eigen::Index j = 0; j < joints; ++j) {
    const Eigen::MatrixXd& columns = W[static_cast<std::size_t>(j)];
    const double gain = identification.gains[j];
    const Eigen::ArrayXd torque = (columns * identification.parameters).array();
    const Eigen::ArrayXd variance = gain * gain * model_variance(identification, columns, acting);
    out.mean.col(j) = gain * torque;
    out.model_sigma.col(j) = variance.sqrt();
    out.sigma.col(j) = (variance + std::pow(identification.sigma[j], 2)).sqrt();
  }
  return out;
}

Eigen::MatrixXd predict_torque_mean(const Identification& identification,
                                    const Eigen::VectorXd& parameters, const Eigen::MatrixXd& q,
                                    const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq) {
  KINESCOPE_CHECK(parameters.size() == identification.parameters.size(),
                  "one value a base parameter");
  const std::vector<Eigen::MatrixXd> W = kept_columns(identification, q, dq, ddq);
  Eigen::MatrixXd mean(q.rows(), static_cast<Eigen::Index>(W.size()));
  for (Eigen::Index j = 0; j < mean.cols(); ++j) {
    mean.col(j) = identification.gains[j] * (W[static_cast<std::size_t>(j)] * parameters);
  }
  return mean;
}

Eigen::VectorXd normalised_error_percent(const Eigen::MatrixXd& measured,
                                         const Eigen::MatrixXd& predicted,
                                         const Eigen::MatrixXd& weights) {
  KINESCOPE_CHECK(measured.rows() == predicted.rows() && measured.cols() == predicted.cols(),
                  "predictions of the measured samples");
  Eigen::VectorXd out(measured.cols());
  for (Eigen::Index j = 0; j < measured.cols(); ++j) {
    const Eigen::ArrayXd used = weights.size() > 0
                                    ? (weights.col(j).array() > 0.0).cast<double>().eval()
                                    : Eigen::ArrayXd::Ones(measured.rows()).eval();
    const double count = used.sum();
    const double mean = (used * measured.col(j).array()).sum() / count;
    const double variance = (used * (measured.col(j).array() - mean).square()).sum();
    const double error = (used * (measured.col(j) - predicted.col(j)).array().square()).sum();
    const double size = (used * measured.col(j).array().square()).sum();
    // A constant channel has nothing to explain but the rounding of its filter.
    constexpr double kRounding = 1e-20;
    out[j] = variance > kRounding * size ? 100.0 * error / variance
                                         : std::numeric_limits<double>::quiet_NaN();
  }
  return out;
}

}  // namespace kinescope
