// SPDX-License-Identifier: Apache-2.0
//
// Small models and policies with random numbers, for tests of gradients.
#pragma once

#include "dynamics/policy/particles.h"
#include "dynamics/policy/rbf_policy.h"
#include "kinematics/core/rng.h"

namespace kinescope::policy {

/// Products of a speed and a trigonometric function with their squares.
class TestPhysics : public PhysicsFeatures {
 public:
  [[nodiscard]] Eigen::Index count() const override { return 3; }
  void evaluate(const ConstBlock& inputs, Block values) const override {
    values.col(0) = inputs.col(1).array() * inputs.col(3).array();
    values.col(1) = inputs.col(4).array() * inputs.col(5).array();
    values.col(2) = inputs.col(2).array().square();
  }
  void pullback(const ConstBlock& inputs, const ConstBlock& d_values,
                Block d_inputs) const override {
    d_inputs.col(1).array() += d_values.col(0).array() * inputs.col(3).array();
    d_inputs.col(3).array() += d_values.col(0).array() * inputs.col(1).array();
    d_inputs.col(4).array() += d_values.col(1).array() * inputs.col(5).array();
    d_inputs.col(5).array() += d_values.col(1).array() * inputs.col(4).array();
    d_inputs.col(2).array() += 2.0 * d_values.col(2).array() * inputs.col(2).array();
  }
};

inline StateLayout cart_pole_layout() {
  return {{"cart", "pole"}, {false, true}, {"force"}, Eigen::VectorXd::Constant(1, 10.0), 0.05};
}

inline Eigen::MatrixXd random_matrix(Rng& rng, Eigen::Index rows, Eigen::Index cols, double sigma) {
  Eigen::MatrixXd out(rows, cols);
  for (double& x : out.reshaped()) x = rng.normal(sigma);
  return out;
}

/// A process of `samples` random inputs of a cart and a pole.
inline VelocityProcess random_process(Rng& rng, VelocityKernel kernel, Eigen::Index samples) {
  VelocityProcess out;
  out.inputs = random_matrix(rng, samples, 6, 1.0);
  for (Eigen::Index i = 0; i < samples; ++i) {
    const double angle = rng.uniform(-3.0, 3.0);
    out.inputs(i, 3) = std::sin(angle);
    out.inputs(i, 4) = std::cos(angle);
    out.inputs(i, 5) *= 5.0;
  }
  out.targets = random_matrix(rng, samples, 1, 0.5);
  out.target_scale = 0.7;
  out.kernel.variance = 0.8;
  out.kernel.length_scales = Eigen::VectorXd::LinSpaced(6, 1.5, 3.0);
  out.kernel.length_scales[5] = 8.0;
  out.kernel.noise_variance = 0.05;
  Eigen::VectorXd weights = Eigen::VectorXd::LinSpaced(6, 0.05, 0.2);
  weights[5] = 0.004;
  if (kernel == VelocityKernel::kPolynomial2) {
    out.kernel.factors = {{0.3, weights}, {1.0, 0.5 * weights}};
  }
  if (kernel == VelocityKernel::kSemiParametric) {
    out.kernel.factors = {{0.0, Eigen::Vector3d(0.2, 0.01, 0.05)}};
  }
  return out;
}

inline VelocityModel random_model(VelocityKernel kernel, Eigen::Index samples,
                                  std::uint64_t seed = 1) {
  Rng rng(seed);
  VelocityModel out{cart_pole_layout(), kernel, {}, nullptr};
  if (kernel == VelocityKernel::kSemiParametric) out.physics = std::make_shared<TestPhysics>();
  for (int p = 0; p < 2; ++p) out.processes.push_back(random_process(rng, kernel, samples));
  return out;
}

inline RbfPolicy random_policy(int basis_count, std::uint64_t seed = 2) {
  Rng rng(seed);
  RbfPolicy out{random_matrix(rng, basis_count, 5, 1.0), Eigen::VectorXd::LinSpaced(5, 1.0, 2.0),
                random_matrix(rng, basis_count, 1, 5.0), Eigen::VectorXd::Constant(1, 10.0)};
  return out;
}

inline PolicyTask random_task(int steps) {
  PolicyTask out;
  out.cost.terms = {{0, 0.2, 1.0, CostError::kDifference}, {1, 3.1, 3.0, CostError::kAbsolute}};
  out.start.means = Eigen::MatrixXd::Zero(1, 4);
  out.start.sigma = Eigen::VectorXd::Constant(4, 0.3);
  out.steps = steps;
  return out;
}

}  // namespace kinescope::policy
