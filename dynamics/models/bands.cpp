// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/bands.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "dynamics/data/splits.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// Two-sided quantiles of the normal distribution.
constexpr double kNormal90 = 1.6448536;
constexpr double kNormal95 = 1.9599640;
// Below so many residuals the 95 % quantile is the largest one or nearly so.
constexpr std::size_t kFewest = 40;

// The smallest value that `level` of n + 1 exchangeable ones do not exceed.
double quantile(const std::vector<double>& ascending, double level) {
  const auto n = static_cast<double>(ascending.size());
  const auto rank = static_cast<std::size_t>(std::ceil(level * (n + 1.0)));
  return ascending[std::min(rank, ascending.size()) - 1];
}

}  // namespace

double BandFactors::width_90(Eigen::Index joint) const {
  return of_90.size() > 0 ? of_90[joint] : kNormal90;
}

double BandFactors::width_95(Eigen::Index joint) const {
  return of_95.size() > 0 ? of_95[joint] : kNormal95;
}

BandFactors bands_of(const Eigen::MatrixXd& residual, const Eigen::MatrixXd& sigma) {
  BandFactors out{Eigen::VectorXd::Constant(residual.cols(), kNormal90),
                  Eigen::VectorXd::Constant(residual.cols(), kNormal95)};
  for (Eigen::Index j = 0; j < residual.cols(); ++j) {
    std::vector<double> z;
    for (Eigen::Index i = 0; i < residual.rows(); ++i) {
      const double value = std::abs(residual(i, j)) / sigma(i, j);
      if (std::isfinite(value)) z.push_back(value);
    }
    if (z.size() < kFewest) continue;
    std::ranges::sort(z);
    out.of_90[j] = quantile(z, 0.90);
    out.of_95[j] = quantile(z, 0.95);
  }
  return out;
}

BandFactors cross_validated_bands(const TorqueSamples& samples, int folds,
                                  const FoldPredictor& predict) {
  Eigen::MatrixXd residual(samples.size(), samples.joints());
  Eigen::MatrixXd sigma(samples.size(), samples.joints());
  Folds parts;
  try {
    parts = split_folds(samples, {.folds = folds});
    for (const Fold& fold : parts.folds) {
      const TorqueSamples test = select_rows(samples, fold.test);
      const TorquePrediction p = predict(select_rows(samples, fold.train), test);
      residual(fold.test, Eigen::all) = test.torque - p.mean;
      sigma(fold.test, Eigen::all) = p.sigma;
    }
  } catch (const Error&) {
    return {};  // too short to leave something out
  }
  BandFactors out = bands_of(residual, sigma);
  out.folds = static_cast<int>(parts.folds.size());
  return out;
}

}  // namespace kinescope
