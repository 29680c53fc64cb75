// SPDX-License-Identifier: Apache-2.0
//
// Every piece of the rollout by itself: its value against a second road, its pullback against
// central differences.
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "dynamics/gp/kernel.h"
#include "dynamics/policy/kernel_matrix.h"
#include "dynamics/policy/velocity_posterior.h"
#include "kinematics/core/error.h"
#include "tests/dynamics/policy/differences.h"
#include "tests/dynamics/policy/policy_world.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

constexpr double kDifferences = 1e-8;  // of central differences, see differences.h
constexpr double kRounding = 1e-11;

TEST(Lanes, ExponentialIsThatOfTheLibrary) {
  // One sample at 0, particles at sqrt(2 x): k = exp(-x).
  KernelValues kernel;
  kernel.length_scales = Eigen::VectorXd::Ones(1);
  const Eigen::MatrixXd origin = Eigen::MatrixXd::Zero(1, 1);
  const PreparedSamples samples(kernel, origin, origin, Eigen::VectorXd::Ones(1));
  Rng rng(4);
  LaneMatrix smooth(8, 1);
  LaneMatrix whole(8, 1);
  Eigen::MatrixXd mean(8, 1);
  for (int trial = 0; trial < 2000; ++trial) {
    Eigen::MatrixXd x(8, 1);
    for (double& v : x.reshaped()) v = rng.uniform(0.0, trial % 2 == 0 ? 3.0 : 37.0);
    kernel_value(samples, x, x, smooth, whole, mean);
    for (Index i = 0; i < 8; ++i) {
      const double exponent = -0.5 * x(i, 0) * x(i, 0);
      // A rounded exponent moves the result by as much.
      const double tolerance = 1e-15 + 2.3e-16 * std::abs(exponent);
      EXPECT_NEAR(smooth(i, 0) / std::exp(exponent), 1.0, tolerance) << exponent;
    }
  }
  kernel_value(samples, Eigen::MatrixXd::Constant(8, 1, 1e9), origin, smooth, whole, mean);
  EXPECT_EQ(smooth(3, 0), 0.0);
}

TEST(TriangleProduct, IsThatOfFullMatrices) {
  Rng rng(5);
  for (const Index size : {1, 7, 8, 9, 37, 64}) {
    for (const Index rows : {8, 16, 24, 40}) {
      Eigen::MatrixXd factor = random_matrix(rng, size, size, 1.0);
      factor.triangularView<Eigen::StrictlyUpper>().setZero();
      const TriangleProduct product(factor);
      const Eigen::MatrixXd in = random_matrix(rng, rows, size, 1.0);
      LaneMatrix lanes(rows, size);
      for (Index i = 0; i < rows; ++i) {
        for (Index j = 0; j < size; ++j) lanes.group(i / 8)[j * 8 + i % 8] = in(i, j);
      }
      LaneMatrix v(rows, size);
      LaneMatrix w(rows, size);
      product.times_transposed(lanes, v);
      product.times(lanes, w);
      const Eigen::MatrixXd expected_v = in * factor.transpose();
      const Eigen::MatrixXd expected_w = in * factor;
      for (Index i = 0; i < rows; ++i) {
        for (Index j = 0; j < size; ++j) {
          EXPECT_NEAR(v(i, j), expected_v(i, j), kRounding);
          EXPECT_NEAR(w(i, j), expected_w(i, j), kRounding);
        }
      }
    }
  }
}

TEST(StateFeatures, PullbackIsThatOfDifferences) {
  Rng rng(1);
  const StateLayout layout{
      {"a", "b", "c"}, {true, false, true}, {"u"}, Eigen::VectorXd::Ones(1), 0.1};
  const Index features = feature_count(layout);
  EXPECT_EQ(static_cast<std::size_t>(features), feature_names(layout).size());
  const Eigen::MatrixXd states = random_matrix(rng, 4, 6, 1.0);
  const Eigen::MatrixXd weights = random_matrix(rng, 4, features, 1.0);
  const auto value = [&](const Eigen::MatrixXd& x) {
    Eigen::MatrixXd out(4, features);
    state_features(layout, x, out);
    return out.cwiseProduct(weights).sum();
  };
  Eigen::MatrixXd at(4, features);
  state_features(layout, states, at);
  Eigen::MatrixXd d_states = Eigen::MatrixXd::Zero(4, 6);
  state_features_pullback(layout, at, weights, d_states);
  EXPECT_LT(largest(d_states - differences(value, states)), kDifferences);
}

TEST(SaturatingCost, PullbackIsThatOfDifferences) {
  Rng rng(2);
  const SaturatingCost cost{{{0, 0.3, 1.2, CostError::kDifference},
                             {1, 2.0, 1.5, CostError::kAbsolute},
                             {1, 0.5, 2.0, CostError::kCircular},
                             {3, 0.0, 4.0, CostError::kDifference}}};
  const Eigen::MatrixXd states = random_matrix(rng, 6, 4, 1.0);
  const Eigen::VectorXd weights = random_matrix(rng, 6, 1, 1.0);
  Eigen::MatrixXd d_states = Eigen::MatrixXd::Zero(6, 4);
  state_cost_pullback(cost, states, state_cost(cost, states), weights, d_states);
  const auto value = [&](const Eigen::MatrixXd& x) { return state_cost(cost, x).dot(weights); };
  EXPECT_LT(largest(d_states - differences(value, states)), kDifferences);
}

TEST(SaturatingCost, IsZeroAtTheTargetFromBothSides) {
  const SaturatingCost cost{{{1, std::numbers::pi, 3.0, CostError::kAbsolute}}};
  Eigen::MatrixXd states = Eigen::MatrixXd::Zero(3, 4);
  states(0, 1) = std::numbers::pi;
  states(1, 1) = -std::numbers::pi;
  const Eigen::VectorXd costs = state_cost(cost, states);
  EXPECT_EQ(costs[0], 0.0);
  EXPECT_EQ(costs[1], 0.0);
  EXPECT_NEAR(costs[2], 1.0 - std::exp(-std::numbers::pi * std::numbers::pi / 9.0), 1e-15);
}

// A filter is linear: its pullback, over a run, against differences.
TEST(ParticleFilter, PullbackIsThatOfDifferences) {
  Rng rng(3);
  const StateLayout layout = cart_pole_layout();
  constexpr int kSteps = 5;
  for (const Sensing sensing : {Sensing::kFullState, Sensing::kPositionsOnly}) {
    const SensingOptions options{sensing, {}, 3.0, 5.0};
    const Eigen::MatrixXd states = random_matrix(rng, kSteps, 4, 1.0);
    const Eigen::MatrixXd weights = random_matrix(rng, kSteps, 4, 1.0);
    ParticleFilter filter(layout, options, 1);
    const auto value = [&](const Eigen::MatrixXd& x) {
      double out = 0.0;
      SeenStates seen;
      filter.start();
      for (int t = 0; t < kSteps; ++t) {
        filter.step({x.row(t)}, {}, seen);
        out += seen.values.row(0).dot(weights.row(t));
      }
      return out;
    };
    const Eigen::MatrixXd expected = differences(value, states);
    Eigen::MatrixXd d_states = Eigen::MatrixXd::Zero(kSteps, 4);
    filter.start_pullback();
    for (int t = kSteps - 1; t >= 0; --t) {
      Eigen::MatrixXd row = Eigen::MatrixXd::Zero(1, 4);
      const Eigen::MatrixXd d_seen = weights.row(t);
      filter.pullback(d_seen, t == 0, row);
      d_states.row(t) = row;
    }
    EXPECT_LT(largest(d_states - expected), kDifferences);
  }
}

TEST(OnlineFilter, FollowsARampWithTheRightSpeed) {
  const StateLayout layout = cart_pole_layout();
  OnlineFilter filter(layout, {Sensing::kPositionsOnly, {}, 0.0, 5.0});
  Eigen::VectorXd seen;
  for (int k = 0; k < 40; ++k) {
    seen = filter.step(Eigen::Vector4d(0.05 * k, -0.1 * k, 99.0, 99.0));
  }
  // The low-pass forgets by exp(-2 pi 5 * 0.05) = 0.2 a step.
  EXPECT_NEAR(seen[2], 1.0, 1e-12);
  EXPECT_NEAR(seen[3], -2.0, 1e-12);
  EXPECT_NEAR(low_pass_memory(5.0, 0.05), 0.2079, 1e-4);
}

TEST(RbfPasses, AreThePolicyAndItsGradient) {
  Rng rng(6);
  for (const Index features : {3, 5, 6, 9}) {
    RbfPolicy policy{random_matrix(rng, 7, features, 1.0),
                     Eigen::VectorXd::LinSpaced(features, 0.8, 2.0), random_matrix(rng, 7, 2, 3.0),
                     Eigen::Vector2d(2.0, 5.0)};
    const Eigen::MatrixXd seen = random_matrix(rng, 16, features, 1.0);
    const Eigen::MatrixXd weights = random_matrix(rng, 16, 2, 1.0);
    const auto run = [&](const Eigen::MatrixXd& z, const RbfPolicy& p, Eigen::MatrixXd& basis,
                         Eigen::MatrixXd& inputs) {
      const PreparedPolicy prepared(p);
      basis = Eigen::MatrixXd::Ones(16, even(p.basis_count()));
      inputs.resize(16, 2);
      policy_value(prepared, z * prepared.inverse_scales.asDiagonal(), basis, inputs);
      return inputs.cwiseProduct(weights).sum();
    };
    Eigen::MatrixXd basis;
    Eigen::MatrixXd inputs;
    static_cast<void>(run(seen, policy, basis, inputs));
    const PreparedPolicy prepared(policy);
    PolicyGradient gradient(policy);
    Eigen::MatrixXd d_inputs = weights;
    Eigen::MatrixXd d_scaled(16, features);
    policy_pullback(prepared, seen * prepared.inverse_scales.asDiagonal(), basis, inputs, d_inputs,
                    d_scaled, gradient);
    finish_gradient(prepared, gradient);
    Eigen::MatrixXd unused;
    Eigen::MatrixXd other;
    const auto by = [&](auto change) {
      return [&, change](const Eigen::MatrixXd& x) {
        RbfPolicy moved = policy;
        change(moved, x);
        return run(seen, moved, unused, other);
      };
    };
    const Eigen::MatrixXd d_seen = d_scaled * prepared.inverse_scales.asDiagonal();
    EXPECT_LT(
        largest(d_seen -
                differences([&](const Eigen::MatrixXd& z) { return run(z, policy, unused, other); },
                            seen)),
        kDifferences);
    EXPECT_LT(largest(gradient.centres.topRows(7) -
                      differences(by([](RbfPolicy& p, const Eigen::MatrixXd& x) { p.centres = x; }),
                                  policy.centres)),
              kDifferences);
    EXPECT_LT(largest(gradient.weights.topRows(7) -
                      differences(by([](RbfPolicy& p, const Eigen::MatrixXd& x) { p.weights = x; }),
                                  policy.weights)),
              kDifferences);
    const Eigen::MatrixXd logs = policy.length_scales.array().log();
    EXPECT_LT(largest(gradient.log_scales.transpose() -
                      differences(by([](RbfPolicy& p, const Eigen::MatrixXd& x) {
                                    p.length_scales = x.array().exp();
                                  }),
                                  logs)),
              kDifferences);
  }
}

class Kernels : public ::testing::TestWithParam<VelocityKernel> {};

TEST_P(Kernels, PosteriorIsThatOfTheTextbookAndItsPullbackThatOfDifferences) {
  Rng rng(7);
  const VelocityModel model = random_model(GetParam(), 19);
  const VelocityProcess& process = model.processes[0];
  const PhysicsFeatures* physics = model.physics.get();
  const VelocityPosterior posterior(process, physics);
  const Eigen::MatrixXd inputs = random_matrix(rng, 8, 6, 1.2);
  const Index linear = physics != nullptr ? physics->count() : 6;
  PosteriorTape tape(8, 6, 19);
  PosteriorScratch scratch(8, 6, linear, 19);
  const auto predict = [&](const Eigen::MatrixXd& x, bool with_tape) {
    posterior.predict(x, linear_columns(x, physics), with_tape, tape, scratch);
  };
  predict(inputs, true);

  // Rasmussen and Williams 2006, eqs. 2.25 and 2.26.
  Eigen::MatrixXd a = kernel_matrix(process.kernel, process.inputs, process.inputs, physics);
  a.diagonal().array() += process.kernel.noise_variance;
  const Eigen::MatrixXd k = kernel_matrix(process.kernel, inputs, process.inputs, physics);
  const Eigen::VectorXd mean = k * a.llt().solve(process.targets);
  const Eigen::VectorXd variance = kernel_diagonal(process.kernel, inputs, physics) -
                                   (k * a.llt().solve(k.transpose())).diagonal();
  EXPECT_LT(largest(tape.mean - mean), kRounding);
  EXPECT_LT(largest(tape.deviation.array().square().matrix() - variance), kRounding);

  const Eigen::MatrixXd d_mean = random_matrix(rng, 8, 1, 1.0);
  const Eigen::MatrixXd d_deviation = random_matrix(rng, 8, 1, 1.0);
  Eigen::MatrixXd d_inputs = Eigen::MatrixXd::Zero(8, 6);
  Eigen::MatrixXd d_linear = Eigen::MatrixXd::Zero(8, linear);
  posterior.pullback(linear_columns(inputs, physics), tape, d_mean, d_deviation, scratch, d_inputs,
                     d_linear);
  if (physics != nullptr) {
    physics->pullback(inputs, d_linear, d_inputs);
  } else if (posterior.factors() > 0) {
    d_inputs += d_linear;
  }
  const auto value = [&](const Eigen::MatrixXd& x) {
    predict(x, false);
    return tape.mean.cwiseProduct(d_mean).sum() + tape.deviation.cwiseProduct(d_deviation).sum();
  };
  EXPECT_LT(largest(d_inputs - differences(value, inputs)), 10.0 * kDifferences);
}
INSTANTIATE_TEST_SUITE_P(All, Kernels,
                         ::testing::Values(VelocityKernel::kSquaredExponential,
                                           VelocityKernel::kPolynomial2,
                                           VelocityKernel::kSemiParametric));

TEST(RobustCholesky, AddsWhatASingularMatrixNeedsAndSaysSo) {
  const Eigen::MatrixXd ones = Eigen::MatrixXd::Ones(5, 5);
  const Factor factor = robust_cholesky(ones);
  EXPECT_GT(factor.jitter, 0.0);
  EXPECT_LE(factor.jitter, 1e-6);
  EXPECT_LT(largest(factor.lower * factor.lower.transpose() - ones), 2.0 * factor.jitter);
  EXPECT_EQ(robust_cholesky(Eigen::MatrixXd::Identity(3, 3)).jitter, 0.0);
  EXPECT_THROW(static_cast<void>(robust_cholesky(-ones)), Error);
}

}  // namespace
}  // namespace kinescope::policy
