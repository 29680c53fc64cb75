// SPDX-License-Identifier: Apache-2.0
//
// The gradient of the expected cost against central differences with common random numbers.
#include <gtest/gtest.h>

#include "dynamics/policy/improve.h"
#include "dynamics/policy/particle_objective.h"
#include "tests/dynamics/policy/policy_world.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

struct Case {
  const char* name;
  VelocityKernel kernel;
  Sensing sensing;
  double noise;
  double dropout;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class RolloutGradient : public ::testing::TestWithParam<Case> {};

// 24 particles, some of a second block's rows unused; six steps.
TEST_P(RolloutGradient, IsThatOfCentralDifferences) {
  constexpr int kParticles = 21;
  const VelocityModel model = random_model(GetParam().kernel, 17);
  PolicyTask task = random_task(6);
  task.sensing = {GetParam().sensing, {}, 8.0, 4.0};
  if (GetParam().noise > 0.0) {
    task.sensing.noise_sigma = Eigen::VectorXd::Constant(4, GetParam().noise);
  }
  task.start.means.resize(2, 4);
  task.start.means << 0.0, 0.0, 0.0, 0.0, 0.4, -0.5, 0.1, 0.3;
  const RbfPolicy policy = random_policy(13);
  const RolloutDraws draws{7, 3, GetParam().dropout};
  ParticleObjective objective(model, task, kParticles, policy.basis_count(), 1);
  PolicyGradient gradient(policy);
  static_cast<void>(objective.evaluate(policy, draws, &gradient));
  const Eigen::VectorXd exact = search_gradient(gradient, policy);
  const Eigen::VectorXd at = parameters_of(policy);
  // Truncation of (1e-5)^2 and rounding of 1e-15 / 1e-5, relative to the largest entry.
  constexpr double kStep = 1e-5;
  constexpr double kTolerance = 1e-7;
  ASSERT_GT(exact.cwiseAbs().minCoeff(), 0.0);
  for (Index i = 0; i < at.size(); ++i) {
    double values[2];
    for (int side = 0; side < 2; ++side) {
      Eigen::VectorXd moved = at;
      moved[i] += side == 0 ? -kStep : kStep;
      values[side] = objective.evaluate(with_parameters(policy, moved), draws, nullptr).cost;
    }
    EXPECT_NEAR((values[1] - values[0]) / (2.0 * kStep), exact[i],
                kTolerance * exact.cwiseAbs().maxCoeff())
        << "parameter " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Models, RolloutGradient,
    ::testing::Values(Case{"se", VelocityKernel::kSquaredExponential, Sensing::kFullState, 0, 0},
                      Case{"se_dropout", VelocityKernel::kSquaredExponential, Sensing::kFullState,
                           0.02, 0.25},
                      Case{"p2", VelocityKernel::kPolynomial2, Sensing::kFullState, 0, 0.25},
                      Case{"semi", VelocityKernel::kSemiParametric, Sensing::kFullState, 0, 0},
                      Case{"positions_only", VelocityKernel::kSquaredExponential,
                           Sensing::kPositionsOnly, 0.01, 0.125}),
    [](const auto& one) { return std::string(one.param.name); });

TEST(ParticleObjective, HasTheSameBitsAtAnyNumberOfThreads) {
  const VelocityModel model = random_model(VelocityKernel::kPolynomial2, 30);
  const PolicyTask task = random_task(8);
  const RbfPolicy policy = random_policy(20);
  const RolloutDraws draws{5, 1, 0.25};
  ParticleObjective one(model, task, 150, policy.basis_count(), 1);
  PolicyGradient expected(policy);
  const ParticleCost cost = one.evaluate(policy, draws, &expected);
  for (const int threads : {2, 3, 5}) {
    ParticleObjective many(model, task, 150, policy.basis_count(), threads);
    PolicyGradient gradient(policy);
    EXPECT_EQ(many.evaluate(policy, draws, &gradient).cost, cost.cost) << threads;
    EXPECT_EQ(gradient.centres, expected.centres) << threads;
    EXPECT_EQ(gradient.weights, expected.weights) << threads;
    EXPECT_EQ(gradient.log_scales, expected.log_scales) << threads;
  }
}

}  // namespace
}  // namespace kinescope::policy
