// SPDX-License-Identifier: Apache-2.0
//
// Data for the tests of the room: random inputs, functions drawn from a kernel.
#pragma once

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "dynamics/gp/gaussian_process.h"
#include "kinematics/core/rng.h"

namespace kinescope::gp {

/// Of central differences.
inline constexpr double kDifferenceStep = 1e-5;
/// Two algorithms for one number, kernel matrices with a condition number up to 1e6.
inline constexpr double kTwoRoads = 1e-8;

inline Eigen::MatrixXd random_matrix(Rng& rng, Eigen::Index rows, Eigen::Index cols,
                                     double sigma = 1.0) {
  Eigen::MatrixXd out(rows, cols);
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < cols; ++j) out(i, j) = rng.normal(sigma);
  }
  return out;
}

/// Other values than the defaults, so that no two parameters are alike.
inline Kernel shuffled_parameters(const Kernel& kernel, Rng& rng, double sigma = 0.4) {
  Eigen::VectorXd values = kernel.log_values();
  for (double& value : values) value += rng.normal(sigma);
  return kernel.with_log_values(values);
}

/// A smooth function of the inputs, with noise.
inline Dataset smooth_data(Rng& rng, Eigen::Index samples, Eigen::Index dimensions,
                           double noise_sigma) {
  Dataset out;
  out.inputs = random_matrix(rng, samples, dimensions);
  out.targets.resize(samples, 1);
  for (Eigen::Index i = 0; i < samples; ++i) {
    double value = 0.0;
    for (Eigen::Index d = 0; d < dimensions; ++d) {
      value += std::sin((1.0 + 0.3 * static_cast<double>(d)) * out.inputs(i, d)) /
               (1.0 + static_cast<double>(d));
    }
    out.targets(i, 0) = value + rng.normal(noise_sigma);
  }
  return out;
}

/// Targets drawn from the model itself.
inline Dataset drawn_data(Rng& rng, const GpModel& model, const Eigen::MatrixXd& inputs,
                          Eigen::VectorXd* function = nullptr) {
  Eigen::MatrixXd k = covariance(model.kernel, inputs);
  const Eigen::Index rows = k.rows();
  k.diagonal().array() += 1e-10 * k.diagonal().mean();
  const Eigen::MatrixXd factor = k.llt().matrixL();
  const Eigen::VectorXd f = factor * random_matrix(rng, rows, 1).col(0);
  if (function != nullptr) *function = f;
  const Eigen::Index outputs = model.kernel.outputs();
  Dataset out{inputs, Eigen::MatrixXd(inputs.rows(), outputs), {}, {}};
  const std::size_t noises = model.noise_variance.size();
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double variance = model.noise_variance[static_cast<std::size_t>(i) % noises].value;
    out.targets(i / outputs, i % outputs) = f[i] + rng.normal(std::sqrt(variance));
  }
  return out;
}

}  // namespace kinescope::gp
