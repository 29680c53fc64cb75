// SPDX-License-Identifier: Apache-2.0
//
// The closed form against refits that have really not seen the fold.
#include "dynamics/gp/leave_out.h"

#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/gp/likelihood.h"
#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {

struct Naive {
  Eigen::MatrixXd mean;
  Eigen::MatrixXd variance;
  double log_density = 0.0;
};

Naive refit(const GpModel& model, const Dataset& data, const std::vector<int>& fold_of,
            const FitOptions& options) {
  Naive out{data.targets, Eigen::MatrixXd::Zero(data.targets.rows(), data.targets.cols()), 0.0};
  const int folds = 1 + *std::max_element(fold_of.begin(), fold_of.end());
  const double all = fit(model, data, options).log_likelihood;
  for (int f = 0; f < folds; ++f) {
    std::vector<Eigen::Index> held, rest;
    for (std::size_t i = 0; i < fold_of.size(); ++i) {
      (fold_of[i] == f ? held : rest).push_back(static_cast<Eigen::Index>(i));
    }
    const FittedGp fitted = fit(model, subset(data, rest), options);
    const Prediction at = predict(fitted, data.inputs(held, Eigen::all));
    out.log_density += all - fitted.log_likelihood;
    for (std::size_t k = 0; k < held.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      out.mean.row(held[k]) = at.mean.row(row);
      Eigen::RowVectorXd noise = at.noise_variance;
      if (data.noise_scale.size() > 0) {
        noise = noise.cwiseProduct(data.noise_scale.row(held[k])).eval();
      }
      out.variance.row(held[k]) = at.variance.row(row) + noise;
    }
  }
  return out;
}

void expect_same(const GpModel& model, const Dataset& data, const std::vector<int>& fold_of,
                 Route route) {
  const FitOptions options{.route = route};
  const LeaveOut closed = leave_out(fit(model, data, options), data, fold_of);
  const Naive naive = refit(model, data, fold_of, options);
  EXPECT_LT((closed.mean - naive.mean).cwiseAbs().maxCoeff(), kTwoRoads);
  EXPECT_LT((closed.variance - naive.variance).cwiseAbs().maxCoeff(), kTwoRoads);
  EXPECT_NEAR(closed.log_density, naive.log_density, kTwoRoads * std::abs(naive.log_density));
  EXPECT_LT((data.targets - closed.mean - closed.residual).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(LeaveOut, DenseIsARefit) {
  Rng rng = Rng::from_name("leave out");
  Dataset data = smooth_data(rng, 90, 2, 0.1);
  data.noise_scale = random_matrix(rng, 90, 1).cwiseAbs().array() + 0.5;
  const GpModel model = make_model(rbf(first_columns(2)), 0.02);
  expect_same(model, data, consecutive_folds(90, 6), Route::kDense);
  std::vector<int> single(90);
  for (int i = 0; i < 90; ++i) single[static_cast<std::size_t>(i)] = i;
  expect_same(model, data, single, Route::kDense);
}

TEST(LeaveOut, FeaturesAreARefit) {
  Rng rng = Rng::from_name("leave out features");
  Dataset data = smooth_data(rng, 90, 2, 0.1);
  data.noise_scale = random_matrix(rng, 90, 1).cwiseAbs().array() + 0.5;
  const GpModel model = make_model(polynomial(first_columns(2), 2), 0.05);
  expect_same(model, data, consecutive_folds(90, 3), Route::kFeatures);   // folds larger than 6
  expect_same(model, data, consecutive_folds(90, 30), Route::kFeatures);  // and smaller
}

TEST(LeaveOut, SeveralOutputsAreARefit) {
  Rng rng = Rng::from_name("leave out outputs");
  const Kernel kernel = independent_outputs({rbf(columns({0})), linear(first_columns(2))});
  const GpModel model = make_model(kernel, 0.1, {}, true);
  const Dataset data = drawn_data(rng, model, random_matrix(rng, 40, 2));
  expect_same(model, data, consecutive_folds(40, 5), Route::kDense);
}

TEST(LeaveOut, ScoreOfLeaveOneOutIsItsDensity) {
  Rng rng = Rng::from_name("loo score");
  const Dataset data = smooth_data(rng, 60, 2, 0.1);
  const GpModel model = make_model(rbf(first_columns(2)), 0.02);
  const auto objective = make_objective(model, data, {}, Score::kLeaveOneOut);
  EXPECT_NEAR(objective->evaluate(log_values_of(model))->value,
              leave_one_out(fit(model, data), data).log_density, kTwoRoads * 100.0);
}

TEST(LeaveOut, SamplesOfNoFoldAreInEveryFit) {
  Rng rng = Rng::from_name("always in");
  const Dataset data = smooth_data(rng, 60, 2, 0.1);
  std::vector<int> fold_of = consecutive_folds(60, 3);
  for (std::size_t i = 0; i < 20; ++i) fold_of[i] = -1;
  for (const Kernel& kernel : {rbf(first_columns(2)), polynomial(first_columns(2), 2)}) {
    const GpModel model = make_model(kernel, 0.05);
    const LeaveOut left = leave_out(fit(model, data), data, fold_of);
    std::vector<Eigen::Index> seen, held;
    for (Eigen::Index i = 0; i < 60; ++i) {
      (fold_of[static_cast<std::size_t>(i)] == 2 ? held : seen).push_back(i);
    }
    const Prediction naive = predict(fit(model, subset(data, seen)), data.inputs(held, Eigen::all));
    EXPECT_LT((left.mean(held, Eigen::all) - naive.mean).cwiseAbs().maxCoeff(), kTwoRoads);
    EXPECT_EQ(left.residual.topRows(20).cwiseAbs().maxCoeff(), 0.0);
  }
}

}  // namespace
}  // namespace kinescope::gp
