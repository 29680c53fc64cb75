// SPDX-License-Identifier: Apache-2.0
#include "calib/design/information.h"

#include <algorithm>
#include <limits>
#include <map>
#include <string>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::design {
namespace {

// Standard deviation of what nobody knows anything of, in the parameter's unit.
double unknown_sigma(const Parameter& parameter) { return parameter.unit == "px" ? 1e3 : 1.0; }

// Where each parameter stands in the calibration, of those that it determined; -1: nowhere.
std::vector<Eigen::Index> places_of(const Calibration& calibration,
                                    const std::vector<Parameter>& parameters) {
  std::map<std::string, Eigen::Index> place;
  for (std::size_t i = 0; i < calibration.parameters.size(); ++i)
    if (calibration.parameters[i].sigma && *calibration.parameters[i].sigma > 0.0)
      place[calibration.parameters[i].name] = static_cast<Eigen::Index>(i);
  std::vector<Eigen::Index> out;
  for (const Parameter& parameter : parameters) {
    const auto found = is_of_recording(parameter) ? place.end() : place.find(parameter.name);
    out.push_back(found == place.end() ? -1 : found->second);
  }
  return out;
}

// Pseudo-inverse: a covariance has no variance along what was not determined at all, which is no
// knowledge (uncertainty.cpp inverts its information likewise).
Eigen::MatrixXd inverse_of_known(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd scale = unit_scale(covariance);
  const SymmetricEigen eigen =
      symmetric_eigen(scale.asDiagonal() * covariance * scale.asDiagonal());
  const auto n = static_cast<double>(eigen.values.size());
  const double rounding =
      n * std::numeric_limits<double>::epsilon() * eigen.values[eigen.values.size() - 1];
  Eigen::VectorXd inverse = Eigen::VectorXd::Zero(eigen.values.size());
  for (Eigen::Index k = 0; k < inverse.size(); ++k)
    if (eigen.values[k] > rounding) inverse[k] = 1.0 / eigen.values[k];
  return scale.asDiagonal() * eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose() *
         scale.asDiagonal();
}

}  // namespace

Eigen::MatrixXd known_information(const Calibration& calibration,
                                  const std::vector<Parameter>& parameters) {
  const auto n = std::ssize(parameters);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  const std::vector<Eigen::Index> places = places_of(calibration, parameters);
  std::vector<Eigen::Index> own, there;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double sigma = unknown_sigma(parameters[static_cast<std::size_t>(i)]);
    out(i, i) = 1.0 / (sigma * sigma);
    if (places[static_cast<std::size_t>(i)] < 0) continue;
    own.push_back(i);
    there.push_back(places[static_cast<std::size_t>(i)]);
  }
  if (!own.empty()) out(own, own) += inverse_of_known(calibration.covariance(there, there));
  return out;
}

Eigen::MatrixXd information_of(const Eigen::MatrixXd& J, double widening) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(J.cols(), J.cols());
  out.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose(), 1.0 / widening);
  return Eigen::MatrixXd(out.selfadjointView<Eigen::Lower>());
}

Eigen::MatrixXd covariance_of(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd scale = unit_scale(information);
  const CholeskyFactor factor(scale.asDiagonal() * information * scale.asDiagonal());
  KINESCOPE_CHECK(factor.positive_definite(), "an information matrix that has an inverse");
  return scale.asDiagonal() * factor.inverse() * scale.asDiagonal();
}

double variance_of(const Eigen::MatrixXd& information, const Eigen::MatrixXd& root) {
  const Eigen::VectorXd scale = unit_scale(information);
  const CholeskyFactor factor(scale.asDiagonal() * information * scale.asDiagonal());
  if (!factor.positive_definite()) return std::numeric_limits<double>::infinity();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * root;
  return scaled.cwiseProduct(factor.solve(scaled)).sum();
}

}  // namespace kinescope::design
