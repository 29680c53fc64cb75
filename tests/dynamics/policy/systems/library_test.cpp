// SPDX-License-Identifier: Apache-2.0
//
// Problems of the literature, what counts as done, features of physics, quantiles of particles.
#include "dynamics/policy/systems/library.h"

#include <cmath>
#include <numbers>

#include <Eigen/QR>
#include <gtest/gtest.h>

#include "dynamics/policy/systems/cart_pole.h"
#include "dynamics/policy/systems/monomials.h"
#include "dynamics/policy/systems/particle_band.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope::policy {
namespace {

using std::numbers::pi;

const Controller kRandom = [](const Eigen::VectorXd&, int step) {
  Rng rng = Rng::from_name("input", static_cast<std::uint64_t>(step));
  return Eigen::VectorXd(Eigen::VectorXd::Constant(1, rng.uniform(-1.0, 1.0)));
};

TEST(ProblemLibrary, EveryProblemRuns) {
  for (const std::string& name : problem_names()) {
    for (const Sensing sensing : {Sensing::kFullState, Sensing::kPositionsOnly}) {
      const PolicyProblem problem = problem_named(name, sensing);
      check_problem(problem);
      const StateLayout& layout = problem.system->layout();
      const auto still = [&](const Eigen::VectorXd&, int) {
        return Eigen::VectorXd(Eigen::VectorXd::Zero(layout.input_count()));
      };
      const Trial trial = problem.system->run(still, problem.task.steps, 1, 0);
      EXPECT_EQ(trial.seen.rows(), problem.task.steps + 1) << name;
      EXPECT_NEAR(problem.task.steps * layout.step_s, 3.0, 0.5 * layout.step_s) << name;
      EXPECT_EQ(trial.smoothed == trial.seen, sensing == Sensing::kFullState) << name;
      EXPECT_FALSE(succeeded(problem, trial)) << name << " does it by itself";
      const Eigen::Matrix2Xd picture =
          problem.skeleton.moving(trial.truth.row(0).head(layout.position_count()));
      EXPECT_TRUE(picture.allFinite()) << name;
    }
  }
  EXPECT_THROW((void)problem_named("cart", Sensing::kFullState), Error);
}

// The links keep their lengths in the drawing, and the pole is up where its angle is pi.
TEST(ProblemLibrary, DrawsThePoleWhereItIs) {
  const Skeleton skeleton = problem_named("cartpole", Sensing::kFullState).skeleton;
  const Eigen::Matrix2Xd up = skeleton.moving(Eigen::Vector2d(0.3, pi));
  EXPECT_NEAR((up.col(1) - Eigen::Vector2d(0.3, 0.5)).norm(), 0.0, 1e-12);
  const Eigen::Matrix2Xd side = skeleton.moving(Eigen::Vector2d(0.3, 0.5 * pi));
  EXPECT_NEAR((side.col(1) - Eigen::Vector2d(0.8, 0.0)).norm(), 0.0, 1e-12);
}

Trial upright_trial(double cart_m, double pole_rad, Eigen::Index begin) {
  Trial out{.seen = Eigen::MatrixXd::Zero(61, 4),
            .smoothed = Eigen::MatrixXd::Zero(61, 4),
            .truth = Eigen::MatrixXd::Zero(61, 4),
            .inputs = Eigen::MatrixXd::Zero(60, 1)};
  out.truth.col(0).tail(61 - begin).setConstant(cart_m);
  out.truth.col(1).tail(61 - begin).setConstant(pole_rad);
  return out;
}

// The last second of 3 s at 0.05 s: samples 40 to 60.
TEST(Success, IsTheLastSecondWithinTolerance) {
  const PolicyProblem problem = problem_named("cartpole", Sensing::kFullState);
  EXPECT_TRUE(succeeded(problem, upright_trial(0.05, pi, 40)));
  EXPECT_TRUE(succeeded(problem, upright_trial(-0.09, -pi + 0.17, 40))) << "from the other side";
  EXPECT_FALSE(succeeded(problem, upright_trial(0.05, pi, 41)));
  EXPECT_FALSE(succeeded(problem, upright_trial(0.11, pi, 40)));
  EXPECT_FALSE(succeeded(problem, upright_trial(0.05, pi + 0.18, 40)));
  EXPECT_FALSE(succeeded(problem, upright_trial(0.05, std::nan(""), 40)));
}

TEST(Success, OfAnAngleOnTheCircle) {
  const SaturatingCost cost{{{0, 3.0, 1.0, CostError::kCircular}}};
  EXPECT_NEAR(position_error(cost, 0, 3.0 + 6.0 * pi), 0.0, 1e-12);
  EXPECT_NEAR(position_error(cost, 0, 3.2 - 2.0 * pi), 0.2, 1e-12);
  EXPECT_EQ(position_error(cost, 1, 7.0), 0.0) << "nobody asks";
}

TEST(Monomials, AreProductsOfColumns) {
  const StateLayout layout = cart_pole().layout;
  const Monomials physics(layout, {"force", "pole speed^2*sin pole", "cart*cos pole*force"});
  // cart, cart speed, pole speed, sin pole, cos pole, force.
  Eigen::MatrixXd inputs(1, 6);
  inputs << 2.0, 3.0, 5.0, 0.6, 0.8, 7.0;
  Eigen::MatrixXd values(1, 3);
  physics.evaluate(inputs, values);
  EXPECT_DOUBLE_EQ(values(0, 0), 7.0);
  EXPECT_DOUBLE_EQ(values(0, 1), 15.0);
  EXPECT_DOUBLE_EQ(values(0, 2), 2.0 * 0.8 * 7.0);
  EXPECT_THROW(Monomials(layout, {"pole"}), Error) << "an angle is seen by sine and cosine";
}

TEST(Monomials, PullBackAsTheyChange) {
  const StateLayout layout = cart_pole().layout;
  const Monomials physics(layout, {"pole speed^2*sin pole", "force*cos pole", "cart speed"});
  Rng rng = Rng::from_name("Monomials.PullBackAsTheyChange");
  Eigen::MatrixXd inputs(4, 6);
  for (double& value : inputs.reshaped()) value = rng.uniform(-2.0, 2.0);
  Eigen::MatrixXd weights(4, 3);
  for (double& value : weights.reshaped()) value = rng.uniform(-1.0, 1.0);
  const auto total = [&](const Eigen::MatrixXd& at) {
    Eigen::MatrixXd values(4, 3);
    physics.evaluate(at, values);
    return values.cwiseProduct(weights).sum();
  };
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Constant(4, 6, 0.5);  // it adds
  physics.pullback(inputs, weights, slopes);
  for (Eigen::Index i = 0; i < inputs.size(); ++i) {
    constexpr double kStep = 1e-6;
    Eigen::MatrixXd above = inputs;
    Eigen::MatrixXd below = inputs;
    above.reshaped()[i] += kStep;
    below.reshaped()[i] -= kStep;
    EXPECT_NEAR(slopes.reshaped()[i] - 0.5, (total(above) - total(below)) / (2.0 * kStep), 1e-8);
  }
}

// The features are enough: the cart-pole's true increments are nearly linear in them.
TEST(Monomials, ExplainTheCartPole) {
  const PolicyProblem problem = problem_named("cartpole", Sensing::kFullState);
  const Controller strong = [](const Eigen::VectorXd& seen, int step) {
    return Eigen::VectorXd(10.0 * kRandom(seen, step));
  };
  std::vector<Trial> trials;
  for (int k = 0; k < 5; ++k) trials.push_back(problem.system->run(strong, 60, 1, k));
  Eigen::MatrixXd features(300, problem.physics->count());
  Eigen::MatrixXd increments(300, 2);
  for (int k = 0; k < 5; ++k) {
    const Eigen::MatrixXd& truth = trials[static_cast<std::size_t>(k)].truth;
    Eigen::MatrixXd inputs(60, 6);
    state_features(problem.system->layout(), truth.topRows(60), inputs.leftCols(5));
    inputs.col(5) = trials[static_cast<std::size_t>(k)].inputs;
    problem.physics->evaluate(inputs, features.middleRows(60 * k, 60));
    increments.middleRows(60 * k, 60) =
        truth.bottomRightCorner(60, 2) - truth.topRightCorner(60, 2);
  }
  const Eigen::MatrixXd fit = features.householderQr().solve(increments);
  const double left = (increments - features * fit).squaredNorm() / increments.squaredNorm();
  std::printf("left unexplained by the monomials: %.2f %%\n", 100.0 * left);
  EXPECT_LT(left, 0.05);
}

TEST(ParticleBand, HoldsTheQuantiles) {
  ParticleRollout rollout;
  rollout.states = {Eigen::MatrixXd(101, 2)};
  for (int k = 0; k <= 100; ++k) rollout.states[0].row(k).setConstant((37 * k) % 101);
  const ParticleBand band = particle_band(rollout, 1);
  EXPECT_DOUBLE_EQ(band.lower(0, 0), 5.0);
  EXPECT_DOUBLE_EQ(band.median(0, 0), 50.0);
  EXPECT_DOUBLE_EQ(band.upper(0, 0), 95.0);
}

}  // namespace
}  // namespace kinescope::policy
