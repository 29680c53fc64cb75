// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/score_test.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "kinematics/core/rng.h"
#include "tests/calib/trace/linear_model.h"

namespace kinescope::trace {
namespace {

// Normal equations lose half of a double's digits, twice solved.
constexpr double kSame = 1e-7;
// solve_without() keeps a ridge of 1e-11 on a diagonal scaled to 1.
constexpr double kRidge = 1e-6;

// Least squares with prior over the rows that are not left out.
struct Plain {
  Eigen::MatrixXd A;        // [J, E]
  Eigen::MatrixXd inverse;  // (A'A + prior)^-1
  Eigen::VectorXd solution;
};

Plain plain_fit(const Linearisation& linear, const Eigen::MatrixXd& E,
                const Eigen::VectorXd& weights) {
  Plain out;
  out.A.resize(linear.residual.size(), kParameters + E.cols());
  out.A << linear.jacobian, E;
  Eigen::MatrixXd H = out.A.transpose() * weights.asDiagonal() * out.A;
  H.topLeftCorner(kParameters, kParameters) += linear.prior;
  out.inverse = H.inverse();
  out.solution = out.inverse * (out.A.transpose() * weights.cwiseProduct(linear.residual));
  return out;
}

Eigen::VectorXd ones(const Linearisation& linear) {
  return Eigen::VectorXd::Ones(linear.residual.size());
}

TEST(ScoreTest, ParametersAreThoseOfLeastSquares) {
  const Linearisation linear = linear_model();
  const NormalSystem system(linear, make_partition(linear));
  const Eigen::MatrixXd E = explicit_columns(linear, effect());
  const Plain plain = plain_fit(linear, E, ones(linear));
  const Score score = score_test(system, effect());
  EXPECT_EQ(score.rank, 2);
  EXPECT_LT(relative(score.theta, plain.solution.tail(2)), kSame);
  // The sum of squares (with the prior's) falls by the gain, against the model's own best fit.
  const Plain own = plain_fit(linear, Eigen::MatrixXd(linear.residual.size(), 0), ones(linear));
  const auto cost = [&](const Plain& fit) {
    return (linear.residual - fit.A * fit.solution).squaredNorm() +
           fit.solution.head(kParameters).dot(linear.prior * fit.solution.head(kParameters));
  };
  EXPECT_NEAR(score.gain, cost(own) - cost(plain), kSame * cost(own));
  EXPECT_NEAR(gain_of(system, effect()), score.gain, kSame * score.gain);
}

TEST(ScoreTest, OneUnitOfAParameterDoesAsMuchAsItsColumnThatTheModelCannotImitate) {
  const Linearisation linear = linear_model();
  const NormalSystem system(linear, make_partition(linear));
  const Eigen::MatrixXd E = explicit_columns(linear, effect());
  const Eigen::MatrixXd& J = linear.jacobian;
  const Eigen::MatrixXd H = J.transpose() * J + linear.prior;
  const Eigen::MatrixXd S = E.transpose() * E - E.transpose() * J * H.inverse() * J.transpose() * E;
  const Score score = score_test(system, effect());
  const double fitted = score.theta.dot(S * score.theta);
  ASSERT_EQ(score.of_one.size(), 2);
  for (Eigen::Index k = 0; k < 2; ++k)
    EXPECT_NEAR(score.of_one[k], std::sqrt(S(k, k) / fitted), kSame * score.of_one[k]);
}

// Liang and Zeger 1986: bread, meat by stretches, bread.
TEST(ScoreTest, CovarianceIsTheSandwichOverStretches) {
  const Linearisation linear = linear_model();
  const Partition partition = make_partition(linear);
  const NormalSystem system(linear, partition);
  const Plain plain = plain_fit(linear, explicit_columns(linear, effect()), ones(linear));
  const Eigen::VectorXd left = linear.residual - plain.A * plain.solution;
  const auto stretches = static_cast<Eigen::Index>(partition.stretches);
  Eigen::MatrixXd scores = Eigen::MatrixXd::Zero(kParameters + 2, stretches);
  for (Eigen::Index row = 0; row < left.size(); ++row) {
    scores.col(partition.stretch[static_cast<std::size_t>(row / kRowsPerInstant)]) +=
        left[row] * plain.A.row(row).transpose();
  }
  const auto m = static_cast<double>(stretches);
  const Eigen::MatrixXd sandwich = partition.widening * m / (m - 1.0) * plain.inverse * scores *
                                   scores.transpose() * plain.inverse;
  const Score score = score_test(system, effect());
  const Eigen::MatrixXd covariance = sandwich.bottomRightCorner(2, 2);
  EXPECT_LT(relative(score.covariance, covariance), kSame);
  const double F = 0.5 * score.theta.dot(covariance.inverse() * score.theta);
  EXPECT_NEAR(score.statistic, F, kSame * F);
}

// The same estimates with one stretch left out after the other.
Eigen::MatrixXd explicit_jackknife(const Linearisation& linear, const Partition& partition,
                                   const Eigen::MatrixXd& E, Eigen::Index count) {
  Eigen::MatrixXd estimates(count, partition.stretches);
  for (int s = 0; s < partition.stretches; ++s) {
    Eigen::VectorXd weights = ones(linear);
    for (Eigen::Index row = 0; row < weights.size(); ++row) {
      if (partition.stretch[static_cast<std::size_t>(row / kRowsPerInstant)] == s)
        weights[row] = 0.0;
    }
    estimates.col(s) = plain_fit(linear, E, weights).solution.tail(count);
  }
  const Eigen::MatrixXd scatter = estimates.colwise() - estimates.rowwise().mean();
  const auto m = static_cast<double>(partition.stretches);
  return partition.widening * (m - 1.0) / m * scatter * scatter.transpose();
}

TEST(ScoreTest, JackknifeIsThatOfRefits) {
  const Linearisation linear = linear_model();
  const Partition partition = make_partition(linear);
  const NormalSystem system(linear, partition);
  const Eigen::MatrixXd none(linear.residual.size(), 0);
  EXPECT_LT(
      relative(jackknife_covariance(system, 2), explicit_jackknife(linear, partition, none, 2)),
      kRidge);
  const Score score = jackknife_test(system, effect());
  const Eigen::MatrixXd E = explicit_columns(linear, effect());
  EXPECT_LT(relative(score.covariance, explicit_jackknife(linear, partition, E, 2)), kRidge);
  EXPECT_LT(relative(score.theta, score_test(system, effect()).theta), kSame);
}

TEST(ScoreTest, WhatTheModelCanDoItselfIsHidden) {
  Linearisation linear = linear_model();
  linear.prior.resize(0, 0);
  // The model's parameters 0 and 1 together do what the first column does.
  const Eigen::MatrixXd E = explicit_columns(linear, effect());
  linear.jacobian.col(0) = E.col(0) - 2.0 * linear.jacobian.col(1);
  const NormalSystem system(linear, make_partition(linear));
  const std::vector<EffectColumn> first{effect()[0]};
  EXPECT_TRUE(score_test(system, first).hidden());
  EXPECT_TRUE(jackknife_test(system, first).hidden());
  EXPECT_EQ(gain_of(system, first), 0.0);
  // Beside it the other one is still seen, alone.
  const Score both = score_test(system, effect());
  EXPECT_EQ(both.rank, 1);
  EXPECT_NEAR(both.theta[1], score_test(system, {effect()[1]}).theta[0], kSame);
}

// The model could do the same, were it not for its prior, which one of its parameters has left by
// one standard deviation: an F of 50 by the scatter of the stretches.
TEST(ScoreTest, WhatOnlyThePriorTellsFromTheModelIsHidden) {
  Linearisation linear = linear_model();
  const Eigen::MatrixXd E = explicit_columns(linear, effect());
  linear.jacobian.col(0) = E.col(0) - 2.0 * linear.jacobian.col(1);
  linear.prior_gradient = Eigen::VectorXd::Zero(kParameters);
  linear.prior_gradient[0] = std::sqrt(linear.prior(0, 0));
  const NormalSystem system(linear, make_partition(linear));
  const std::vector<EffectColumn> first{effect()[0]};
  EXPECT_TRUE(score_test(system, first).hidden());
  EXPECT_TRUE(jackknife_test(system, first).hidden());
  // Beside it the other one is still seen.
  EXPECT_EQ(score_test(system, effect()).rank, 1);
}

TEST(ScoreTest, AnEffectThatNeverActsIsHidden) {
  const Linearisation linear = linear_model();
  const NormalSystem system(linear, make_partition(linear));
  EXPECT_TRUE(score_test(system, {{1, Eigen::VectorXd::Zero(kInstants)}}).hidden());
}

// p-values of pure noise are even: of 400 about 20 below 5 %, give or take 4.4.
TEST(ScoreTest, OfNoiseOneTestInTwentyIsSignificant) {
  constexpr int kRuns = 400;
  Linearisation linear = linear_model();
  Rng rng = Rng::from_name("noise of the score test");
  int significant = 0;
  for (int run = 0; run < kRuns; ++run) {
    for (double& r : linear.residual) r = rng.normal();
    const NormalSystem system(linear, make_partition(linear));
    if (score_test(system, effect()).p_value < 0.05) ++significant;
  }
  EXPECT_GE(significant, 7);
  EXPECT_LE(significant, 36);
}

// Six parameters that act from one instant to another only, as a slip of a marker that is seldom
// seen.
std::vector<EffectColumn> seldom(Eigen::Index first, Eigen::Index count) {
  std::vector<EffectColumn> out;
  for (const int carrier : {0, 1, 2}) {
    for (const double slope : {0.0, 1.0}) {
      Eigen::VectorXd share = Eigen::VectorXd::Zero(kInstants);
      for (Eigen::Index i = 0; i < count; ++i)
        share[first + i] = 1.0 + slope * static_cast<double>(i);
      out.push_back({carrier, share});
    }
  }
  return out;
}

// Stretches are of six instants here: these columns have fewer of them than parameters.
TEST(ScoreTest, FewStretchesAreJudgedByTheNoiseOfTheirRows) {
  Linearisation linear = linear_model(0.0);
  const std::vector<EffectColumn> columns = seldom(96, 24);
  const Eigen::MatrixXd E = explicit_columns(linear, columns);
  constexpr int kRuns = 400;
  Rng rng = Rng::from_name("noise of few stretches");
  int significant = 0;
  for (int run = 0; run < kRuns; ++run) {
    for (double& r : linear.residual) r = rng.normal();
    const NormalSystem system(linear, make_partition(linear));
    const Score score = score_test(system, columns);
    ASSERT_EQ(score.rank, 6);
    if (score.p_value < 0.05) ++significant;
  }
  EXPECT_LE(significant, 36);

  constexpr double kClear = 4.0;
  linear.residual += kClear * E.col(0);
  const NormalSystem system(linear, make_partition(linear));
  EXPECT_LT(score_test(system, columns).p_value, 1e-6);
  EXPECT_LT(jackknife_test(system, columns).p_value, 1e-6);
  const Score score = score_test(system, columns);
  EXPECT_NEAR(score.theta[0], kClear, 4.0 * std::sqrt(score.covariance(0, 0)));
  // Rows that one stretch alone holds may tell of anything that happened then.
  const std::vector<EffectColumn> once = seldom(96, 6);
  EXPECT_EQ(score_test(system, once).p_value, 1.0);
}

// Errors that last longer in some rows than the model's correlation time says: what a window of
// the recording shows, other windows must not show as well.
TEST(ScoreTest, FewStretchesAreJudgedByWhatOtherWindowsShow) {
  Linearisation linear = linear_model(0.0);
  const std::vector<EffectColumn> columns = seldom(96, 24);
  const Eigen::MatrixXd E = explicit_columns(linear, columns);
  constexpr int kRuns = 200;
  constexpr Eigen::Index kWindow = 24;  // instants over which carriers drift together
  Rng rng = Rng::from_name("drift of windows");
  int significant = 0;
  for (int run = 0; run < kRuns; ++run) {
    Eigen::VectorXd drift;
    for (Eigen::Index i = 0; i < kInstants; ++i) {
      if (i % kWindow == 0) drift = Eigen::VectorXd::NullaryExpr(3, [&] { return rng.normal(); });
      linear.residual.segment(i * kRowsPerInstant, kRowsPerInstant) =
          linear.carriers.middleRows(i * kRowsPerInstant, kRowsPerInstant) * (0.6 * drift);
    }
    for (double& r : linear.residual) r += rng.normal();
    const NormalSystem system(linear, make_partition(linear));
    if (score_test(system, columns).p_value < 0.01) ++significant;
  }
  EXPECT_LE(significant, 10);
}

}  // namespace
}  // namespace kinescope::trace
