// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/sparse.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {

TEST(Sparse, EverySampleAsInducingPointIsTheExactFit) {
  Rng rng = Rng::from_name("sparse exact");
  const Dataset data = smooth_data(rng, 80, 2, 0.1);
  const GpModel model = make_model(rbf(first_columns(2)), 0.05, standardise(data));
  const FittedGp exact = fit(model, data);
  const FittedGp sparse = fit_sparse(model, data, data.inputs);
  // The inducing points' matrix has no noise: its rounding, 1e-14 of the diagonal at least.
  constexpr double kTolerance = 1e-5;
  EXPECT_NEAR(exact.log_likelihood, sparse.log_likelihood, kTolerance * 100.0);
  const Eigen::MatrixXd x = random_matrix(rng, 40, 2);
  const Prediction a = predict(exact, x);
  const Prediction b = predict(sparse, x);
  EXPECT_LT((a.mean - b.mean).cwiseAbs().maxCoeff(), kTolerance);
  EXPECT_LT((a.variance - b.variance).cwiseAbs().maxCoeff(), kTolerance);
}

TEST(Sparse, TheBoundIsBelowAndRisesWithThePoints) {
  Rng rng = Rng::from_name("sparse bound");
  const Dataset data = smooth_data(rng, 400, 3, 0.1);
  const GpModel model = make_model(rbf(first_columns(3)), 0.02);
  const double exact = fit(model, data).log_likelihood;
  double last = -1e300;
  for (const Eigen::Index count : {10, 40, 160}) {
    const Eigen::MatrixXd inducing = choose_inducing(model, data, {.count = count});
    ASSERT_EQ(inducing.rows(), count);
    const double bound = fit_sparse(model, data, inducing).log_likelihood;
    EXPECT_LT(bound, exact + 1e-6);
    EXPECT_GT(bound, last);
    last = bound;
  }
  // 160 of 400 samples hold nearly all of a function of three variables.
  EXPECT_NEAR(last, exact, 0.05 * std::abs(exact));
}

TEST(Sparse, PointsDoNotDependOnTheOrderOfSamples) {
  Rng rng = Rng::from_name("sparse order");
  const Dataset data = smooth_data(rng, 200, 2, 0.1);
  std::vector<Eigen::Index> reversed;
  for (Eigen::Index i = 200; i-- > 0;) reversed.push_back(i);
  const GpModel model = make_model(rbf(first_columns(2)), 0.05);
  const InducingOptions options{.count = 20, .candidates = 100};
  EXPECT_EQ(choose_inducing(model, data, options),
            choose_inducing(model, subset(data, reversed), options));
}

TEST(Sparse, LeavesOutNothing) {
  Rng rng = Rng::from_name("sparse leave");
  const Dataset data = smooth_data(rng, 30, 1, 0.1);
  const GpModel model = make_model(rbf(first_columns(1)), 0.05);
  EXPECT_THROW((void)fit(model, data, {.route = Route::kSparse}), Error);
}

}  // namespace
}  // namespace kinescope::gp
