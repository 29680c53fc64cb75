// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/hyperparameters.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {

// Asymptotic: 400 draws from the model leave a log length scale uncertain by about 0.1.
constexpr double kFourSigma = 0.4;

GpModel known_model() {
  GpModel model = make_model(rbf(first_columns(2)), 0.02);
  Eigen::VectorXd values(3);
  values << std::log(2.0), std::log(0.7), std::log(1.6);
  model.kernel = model.kernel.with_log_values(values);
  return model;
}

TEST(Estimate, FindsTheParametersOfDraws) {
  Rng rng = Rng::from_name("estimate");
  const GpModel truth = known_model();
  const Dataset data = drawn_data(rng, truth, random_matrix(rng, 400, 2, 2.0));
  const Estimate found = estimate_hyperparameters(make_model(rbf(first_columns(2)), 0.3), data);
  EXPECT_EQ(found.status, EstimateStatus::kConverged) << found.message;
  const Eigen::VectorXd error = log_values_of(found.model) - log_values_of(truth);
  EXPECT_LT(error.tail(3).cwiseAbs().maxCoeff(), kFourSigma);
  // The variance is seen through a few length scales only.
  EXPECT_LT(std::abs(error[0]), 3.0 * kFourSigma);
  EXPECT_GE(found.score, log_marginal_likelihood(truth, data).value);
  EXPECT_GT(found.score, found.score_before);
  EXPECT_TRUE(found.at_bound.empty());
}

TEST(Estimate, IsTheSameOnEveryRunAndNumberOfThreads) {
  Rng rng = Rng::from_name("estimate again");
  const Dataset data = smooth_data(rng, 300, 2, 0.1);
  const GpModel model = make_model(rbf(first_columns(2)), 0.3);
  EstimateOptions options;
  options.fit.threads = 1;
  const Estimate a = estimate_hyperparameters(model, data, options);
  options.fit.threads = 2;
  const Estimate b = estimate_hyperparameters(model, data, options);
  EXPECT_EQ(a.score, b.score);
  EXPECT_EQ(log_values_of(a.model), log_values_of(b.model));
}

TEST(Estimate, KeepsRangesAndWhatIsHeld) {
  Rng rng = Rng::from_name("ranges");
  const Dataset data = drawn_data(rng, known_model(), random_matrix(rng, 150, 2));
  GpModel model = make_model(rbf(first_columns(2)), 0.02);
  std::vector<Parameter> parameters = model.kernel.parameters();
  parameters[0].fixed = true;
  parameters[0].value = 1.7;
  parameters[1].upper = 0.5;  // truth: 0.7
  parameters[1].value = 0.2;
  model.kernel = model.kernel.with_parameters(parameters);
  const Estimate found = estimate_hyperparameters(model, data);
  EXPECT_DOUBLE_EQ(found.model.kernel.parameters()[0].value, 1.7);
  EXPECT_LE(found.model.kernel.parameters()[1].value, 0.5);
  ASSERT_FALSE(found.at_bound.empty());
  EXPECT_EQ(found.at_bound.front(), "rbf length scale x0");
}

TEST(Estimate, APriorPullsWhatTheDataDoNotSay) {
  Rng rng = Rng::from_name("prior");
  Dataset data = smooth_data(rng, 100, 1, 0.1);
  data.inputs = Eigen::MatrixXd(
      (Eigen::MatrixXd(100, 2) << data.inputs, Eigen::MatrixXd::Zero(100, 1)).finished());
  GpModel model = make_model(rbf(first_columns(2)), 0.1);
  std::vector<Parameter> parameters = model.kernel.parameters();
  parameters[2].prior_value = 5.0;
  parameters[2].prior_log_sigma = 0.5;
  model.kernel = model.kernel.with_parameters(parameters);
  const Estimate found = estimate_hyperparameters(model, data, {.relative_tolerance = 1e-9});
  EXPECT_NEAR(std::log(found.model.kernel.parameters()[2].value), std::log(5.0), 1e-2);
}

TEST(Estimate, FeatureRouteReachesTheDenseOptimum) {
  Rng rng = Rng::from_name("feature estimate");
  const Dataset data = smooth_data(rng, 200, 2, 0.1);
  const GpModel model = make_model(polynomial(first_columns(2), 2) + constant(), 0.1);
  EstimateOptions options{.starts = 1, .relative_tolerance = 1e-9, .samples_for_starts = 200};
  options.fit.route = Route::kDense;
  const double dense = estimate_hyperparameters(model, data, options).score;
  options.fit.route = Route::kFeatures;
  const double features = estimate_hyperparameters(model, data, options).score;
  EXPECT_NEAR(dense, features, 1e-4 * std::abs(dense));
}

// What does not depend on the parameters is computed once, however costly the map is.
TEST(Estimate, AsksTheFeatureMapOnce) {
  Rng rng = Rng::from_name("costly map");
  const Dataset data = smooth_data(rng, 60, 2, 0.1);
  FeatureMap map = first_columns(2);
  int calls = 0;
  map.map = [&calls, plain = map.map](const Inputs& inputs, Features features) {
    ++calls;
    plain(inputs, features);
  };
  const GpModel model = make_model(rbf(map) + linear(map), 0.1);
  const auto objective = make_objective(model, data);
  const Eigen::VectorXd values = log_values_of(model);
  const Likelihood first = objective->evaluate(values).value();
  EXPECT_NE(objective->evaluate(values.array() + 0.3).value().value, first.value);
  EXPECT_EQ(objective->evaluate(values).value().value, first.value);
  EXPECT_EQ(calls, 2);  // of two kernels
}

// With all samples seen by every start nothing is left to climb, and starts that fall behind are
// given up early.
TEST(Estimate, NoClimbIsMadeTwice) {
  Rng rng = Rng::from_name("no climb twice");
  const Dataset data = smooth_data(rng, 120, 2, 0.1);
  const GpModel model = make_model(rbf(first_columns(2)), 0.3);
  EstimateOptions options{.starts = 3, .start_iterations = 100, .samples_for_starts = 120};
  const Estimate all = estimate_hyperparameters(model, data, options);
  ASSERT_EQ(all.starts.size(), 3U);
  const auto best = std::ranges::max_element(all.starts, {}, &Start::score);
  EXPECT_EQ(all.status, EstimateStatus::kConverged);
  EXPECT_EQ(all.evaluations, best->evaluations);
  EXPECT_EQ(all.score, best->score);
  options.start_iterations = 3;
  const Estimate early = estimate_hyperparameters(model, data, options);
  for (const Start& start : early.starts) EXPECT_LT(start.evaluations, 15);
  EXPECT_NEAR(early.score, all.score, 1e-3 * std::abs(all.score));
}

TEST(Estimate, SaysWhichRangeIsWrong) {
  Rng rng = Rng::from_name("bad range");
  const Dataset data = smooth_data(rng, 20, 1, 0.1);
  GpModel model = make_model(rbf(first_columns(1)), 0.1);
  model.noise_variance[0].lower = 2.0;
  model.noise_variance[0].upper = 1.0;
  EXPECT_THROW((void)estimate_hyperparameters(model, data), Error);
}

}  // namespace
}  // namespace kinescope::gp
