// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/prediction.h"

#include <cmath>
#include <limits>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

std::vector<Eigen::MatrixXd> kept_columns(const Identification& identification,
                                          const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                          const Eigen::MatrixXd& ddq) {
  std::vector<TorqueTerm> kept;
  for (const int k : identification.basis.kept) {
    kept.push_back(identification.terms[static_cast<std::size_t>(k)]);
  }
  return term_columns(identification.rigid, identification.drives, kept, q, dq, ddq);
}

/// diag(W covariance W'), infinite where an undetermined parameter acts.
Eigen::ArrayXd model_variance(const Identification& identification, const Eigen::MatrixXd& W) {
  Eigen::MatrixXd covariance = identification.covariance;
  for (const int k : identification.undetermined) covariance(k, k) = 0.0;
  Eigen::ArrayXd variance = (W * covariance).cwiseProduct(W).rowwise().sum().array();
  for (const int k : identification.undetermined) {
    variance = (W.col(k).array() != 0.0).select(std::numeric_limits<double>::infinity(), variance);
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
  for (Eigen::Index j = 0; j < joints; ++j) {
    const Eigen::MatrixXd& columns = W[static_cast<std::size_t>(j)];
    const double gain = identification.gains[j];
    const Eigen::ArrayXd torque = (columns * identification.parameters).array();
    const Eigen::ArrayXd variance = gain * gain * model_variance(identification, columns);
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
    out[j] = 100.0 * error / variance;
  }
  return out;
}

}  // namespace kinescope
