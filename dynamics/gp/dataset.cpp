// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/dataset.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

Eigen::MatrixXd rows_of(const Eigen::MatrixXd& matrix, const std::vector<Eigen::Index>& indices) {
  if (matrix.size() == 0) return {};
  return matrix(indices, Eigen::all);
}

struct Spread {
  Eigen::RowVectorXd mean;
  Eigen::RowVectorXd deviation;
};

Spread spread_of(const Eigen::MatrixXd& values) {
  Spread out;
  out.mean = values.colwise().mean();
  out.deviation =
      ((values.rowwise() - out.mean).colwise().squaredNorm() / static_cast<double>(values.rows()))
          .cwiseSqrt();
  for (Eigen::Index k = 0; k < out.deviation.size(); ++k) {
    // A constant column has a deviation of a few roundings; so have the rates of a joint at rest,
    // whose mean is none either (rad, m, N m per s or s^2).
    constexpr double kRounding = 1e-9;
    if (!(out.deviation[k] > std::max(kRounding, 1e-12 * std::abs(out.mean[k])))) {
      out.deviation[k] = 1.0;
    }
  }
  return out;
}

}  // namespace

Dataset subset(const Dataset& dataset, const std::vector<Eigen::Index>& indices) {
  return {rows_of(dataset.inputs, indices), rows_of(dataset.targets, indices),
          rows_of(dataset.prior_mean, indices), rows_of(dataset.noise_scale, indices)};
}

Eigen::MatrixXd Normalisation::normalised_inputs(const Inputs& inputs) const {
  if (input_shift.size() == 0) return inputs;
  KINESCOPE_CHECK(inputs.cols() == input_shift.size(), "as many columns as were normalised");
  return (inputs.rowwise() - input_shift).array().rowwise() / input_scale.array();
}

Normalisation standardise_targets(const Dataset& dataset) {
  KINESCOPE_CHECK(dataset.targets.rows() > 0, "no sample to normalise");
  Eigen::MatrixXd targets = dataset.targets;
  if (dataset.prior_mean.size() > 0) targets -= dataset.prior_mean;
  Spread spread = spread_of(targets);
  Normalisation out;
  out.target_shift = std::move(spread.mean);
  out.target_scale = std::move(spread.deviation);
  return out;
}

Normalisation standardise(const Dataset& dataset) {
  Normalisation out = standardise_targets(dataset);
  Spread spread = spread_of(dataset.inputs);
  out.input_shift = std::move(spread.mean);
  out.input_scale = std::move(spread.deviation);
  return out;
}

}  // namespace kinescope::gp
