// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/gaussian_process.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <numeric>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "dynamics/gp/likelihood.h"
#include "dynamics/gp/robot_kernels.h"
#include "kinematics/core/error.h"
#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {

// A few hundred operations on numbers of order one.
constexpr double kRounding = 1e-11;

bool same_bytes(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), static_cast<std::size_t>(a.size()) * sizeof(double)) == 0;
}

TEST(Fit, OnePointByHand) {
  GpModel model =
      make_model(3.0 * rbf(columns({0}), LengthScales::kOneEach, Amplitude::kUnit), 1.0);
  const Dataset data{
      Eigen::MatrixXd::Constant(1, 1, 0.5), Eigen::MatrixXd::Constant(1, 1, 2.0), {}, {}};
  const FittedGp fitted = fit(model, data);
  // k = 3, noise 1: mean 3/4 y, variance 3 - 9/4.
  const Prediction at = predict(fitted, data.inputs);
  EXPECT_NEAR(at.mean(0, 0), 1.5, kRounding);
  EXPECT_NEAR(at.variance(0, 0), 0.75, kRounding);
  EXPECT_NEAR(at.noise_variance[0], 1.0, kRounding);
  EXPECT_NEAR(fitted.log_likelihood,
              -0.5 * (4.0 / 4.0 + std::log(4.0) + std::log(2.0 * std::numbers::pi)), kRounding);
  EXPECT_EQ(fitted.jitter, 0.0);
}

TEST(Fit, TwoPointsByHandWithTheirOwnNoise) {
  GpModel model = make_model(rbf(columns({0})), 0.1);
  Dataset data{Eigen::MatrixXd(2, 1), Eigen::MatrixXd(2, 1), {}, Eigen::MatrixXd(2, 1)};
  data.inputs << 0.0, 1.0;
  data.targets << 1.0, -0.5;
  data.noise_scale << 1.0, 5.0;
  const double c = std::exp(-0.5);
  Eigen::Matrix2d k;
  k << 1.1, c, c, 1.5;
  const Eigen::Vector2d at(std::exp(-0.5 * 0.09), std::exp(-0.5 * 0.49));
  const Prediction got = predict(fit(model, data), Eigen::MatrixXd::Constant(1, 1, 0.3));
  EXPECT_NEAR(got.mean(0, 0), at.dot(k.inverse() * data.targets.col(0)), kRounding);
  EXPECT_NEAR(got.variance(0, 0), 1.0 - at.dot(k.inverse() * at), kRounding);
}

// Kernels of all sorts with few features, one and two outputs, heteroscedastic.
TEST(Fit, FeaturesAndKernelMatrixGiveTheSame) {
  const std::vector<std::pair<std::string, Kernel>> kernels = {
      {"cubic", polynomial(first_columns(3), 3)},
      {"gip", gip({JointKind::kRevolute}) + joint_friction(1, 0)},
      {"outputs", independent_outputs({linear(first_columns(3)), polynomial(columns({1}), 2)})}};
  for (const auto& [name, bare] : kernels) {
    Rng rng = Rng::from_name("routes " + name);
    const Kernel kernel = shuffled_parameters(bare, rng);
    GpModel model = make_model(kernel, 0.02, {}, kernel.outputs() > 1);
    if (kernel.outputs() > 1) model.noise_variance[1].value = 0.3;
    Dataset data = drawn_data(rng, model, random_matrix(rng, 120, 3));
    data.noise_scale = random_matrix(rng, 120, kernel.outputs()).cwiseAbs().array() + 0.2;
    const FittedGp dense = fit(model, data, {.route = Route::kDense});
    const FittedGp features = fit(model, data);
    ASSERT_EQ(features.route, Route::kFeatures) << name;
    EXPECT_NEAR(dense.log_likelihood, features.log_likelihood,
                kTwoRoads * std::abs(dense.log_likelihood))
        << name;
    const Eigen::MatrixXd x = random_matrix(rng, 50, 3);
    const Prediction a = predict(dense, x);
    const Prediction b = predict(features, x);
    EXPECT_LT((a.mean - b.mean).cwiseAbs().maxCoeff(), kTwoRoads * a.mean.cwiseAbs().maxCoeff());
    EXPECT_LT((a.variance - b.variance).cwiseAbs().maxCoeff(),
              kTwoRoads * covariance(kernel, x).diagonal().maxCoeff())
        << name;
    const Eigen::VectorXd wa = kernel_weights(dense);
    const Eigen::VectorXd wb = kernel_weights(features);
    EXPECT_LT((wa - wb).cwiseAbs().maxCoeff(), kTwoRoads * wa.cwiseAbs().maxCoeff()) << name;
    const Likelihood la = log_marginal_likelihood(model, data, {.route = Route::kDense});
    const Likelihood lb = log_marginal_likelihood(model, data, {.route = Route::kFeatures});
    EXPECT_LT((la.gradient - lb.gradient).cwiseAbs().maxCoeff(),
              kTwoRoads * la.gradient.cwiseAbs().maxCoeff())
        << name;
  }
}

TEST(Fit, RecoversANoiseFreePolynomial) {
  Rng rng = Rng::from_name("polynomial");
  Dataset data;
  data.inputs = random_matrix(rng, 60, 2);
  const auto truth = [](const Eigen::MatrixXd& x) {
    return Eigen::MatrixXd(1.5 + 2.0 * x.col(0).array() -
                           0.7 * x.col(0).array() * x.col(1).array() +
                           0.4 * x.col(1).array().square());
  };
  data.targets = truth(data.inputs);
  const GpModel model = make_model(polynomial(first_columns(2), 2), 1e-14);
  const Eigen::MatrixXd x = random_matrix(rng, 100, 2);
  const Prediction got = predict(fit(model, data), x);
  // Ridge of sqrt(1e-14) on six features; QR keeps about 1e-9 of that.
  EXPECT_LT((got.mean - truth(x)).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Fit, LikelihoodGradientAgreesWithDifferences) {
  Rng rng = Rng::from_name("likelihood");
  GpModel model = make_model(rbf(first_columns(3)) * linear(columns({1})) + constant(0.3), 0.05);
  const Dataset data = smooth_data(rng, 70, 3, 0.2);
  for (const Score score : {Score::kMarginalLikelihood, Score::kLeaveOneOut}) {
    const auto objective = make_objective(model, data, {}, score);
    const Eigen::VectorXd values = log_values_of(model);
    const Eigen::VectorXd gradient = objective->evaluate(values)->gradient;
    for (Eigen::Index p = 0; p < values.size(); ++p) {
      Eigen::VectorXd plus = values;
      Eigen::VectorXd minus = values;
      plus[p] += kDifferenceStep;
      minus[p] -= kDifferenceStep;
      const double slope = (objective->evaluate(plus)->value - objective->evaluate(minus)->value) /
                           (2.0 * kDifferenceStep);
      EXPECT_NEAR(gradient[p], slope, 1e-5 * std::max(1.0, gradient.cwiseAbs().maxCoeff())) << p;
    }
  }
}

TEST(Fit, PriorMeanAndNormalisationAreUndone) {
  Rng rng = Rng::from_name("mean");
  Dataset data = smooth_data(rng, 80, 2, 0.05);
  const FittedGp plain = fit(make_model(rbf(first_columns(2)), 0.01), data);
  // The same function in other units, on what is known beforehand.
  Dataset moved = data;
  moved.inputs = 1000.0 * data.inputs.array() + 50.0;
  moved.targets = 5.0 * data.targets;
  moved.prior_mean = Eigen::MatrixXd::Constant(80, 1, 3.0);
  moved.targets.array() += 3.0;
  GpModel model = make_model(rbf(first_columns(2)), 0.01);
  model.normalisation.input_shift = Eigen::RowVectorXd::Constant(2, 50.0);
  model.normalisation.input_scale = Eigen::RowVectorXd::Constant(2, 1000.0);
  model.normalisation.target_shift = Eigen::RowVectorXd::Zero(1);
  model.normalisation.target_scale = Eigen::RowVectorXd::Constant(1, 5.0);
  const Eigen::MatrixXd x = random_matrix(rng, 10, 2);
  const Prediction a = predict(plain, x);
  const Eigen::MatrixXd x_moved = 1000.0 * x.array() + 50.0;
  const Prediction b = predict(fit(model, moved), x_moved);
  EXPECT_LT((5.0 * a.mean - b.mean).cwiseAbs().maxCoeff(), kTwoRoads);
  EXPECT_LT((25.0 * a.variance - b.variance).cwiseAbs().maxCoeff(), kTwoRoads);
  EXPECT_NEAR(b.noise_variance[0], 0.25, kRounding);
}

TEST(Fit, ThreadsDoNotShow) {
  Rng rng = Rng::from_name("threads");
  // Several tiles of the factor and of the kernel.
  const Dataset data = smooth_data(rng, 900, 5, 0.1);
  const GpModel model = make_model(rbf(first_columns(5)) + linear(first_columns(5)), 0.01);
  const GpModel finite = make_model(polynomial(first_columns(5), 2), 0.01);
  const Eigen::MatrixXd x = random_matrix(rng, 600, 5);
  for (const GpModel& each : {model, finite}) {
    const Prediction one = predict(fit(each, data, {.threads = 1}), x, {.threads = 1});
    const Likelihood first = log_marginal_likelihood(each, data, {.threads = 1});
    for (const int threads : {2, 3}) {
      const Prediction many =
          predict(fit(each, data, {.threads = threads}), x, {.threads = threads});
      EXPECT_TRUE(same_bytes(one.mean, many.mean));
      EXPECT_TRUE(same_bytes(one.variance, many.variance));
      const Likelihood other = log_marginal_likelihood(each, data, {.threads = threads});
      EXPECT_EQ(first.value, other.value);
      EXPECT_TRUE(same_bytes(first.gradient, other.gradient));
    }
  }
}

// Many tiles, the last one smaller, beside the textbook's formulas on whole matrices.
TEST(Fit, TheFactorInPlaceGivesMeanBandAndLikelihoodOfPlainAlgebra) {
  constexpr double kSame = 1e-10;  // relative, of a condition number about 1e5
  Rng rng = Rng::from_name("in place");
  const Dataset data = smooth_data(rng, 1100, 3, 0.1);
  const GpModel model = make_model(rbf(first_columns(3)), 1e-2);
  const Eigen::MatrixXd at = random_matrix(rng, 300, 3);
  const FittedGp fitted = fit(model, data, {.route = Route::kDense});
  const Prediction predicted = predict(fitted, at);
  Eigen::MatrixXd k = covariance(model.kernel, data.inputs);
  k.diagonal().array() += 1e-2;
  const Eigen::LLT<Eigen::MatrixXd> factor(k);
  const Eigen::MatrixXd cross = covariance(model.kernel, data.inputs, at);
  const Eigen::VectorXd alpha = factor.solve(data.targets.col(0));
  const Eigen::VectorXd mean = cross.transpose() * alpha;
  const Eigen::VectorXd band = covariance(model.kernel, at).diagonal() -
                               factor.matrixL().solve(cross).colwise().squaredNorm().transpose();
  const double likelihood = -0.5 * data.targets.col(0).dot(alpha) -
                            factor.matrixLLT().diagonal().array().log().sum() -
                            0.5 * 1100.0 * std::log(2.0 * std::numbers::pi);
  EXPECT_LT((predicted.mean - mean).cwiseAbs().maxCoeff(), kSame * mean.cwiseAbs().maxCoeff());
  EXPECT_LT((predicted.variance - band).cwiseAbs().maxCoeff(), kSame);
  EXPECT_NEAR(fitted.log_likelihood / likelihood, 1.0, kSame);
}

TEST(Fit, OrderOfSamplesDoesNotMatter) {
  Rng rng = Rng::from_name("order");
  const Dataset data = smooth_data(rng, 300, 3, 0.1);
  std::vector<Eigen::Index> order(300);
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  for (std::size_t i = order.size(); i-- > 1;) {
    std::swap(order[i], order[static_cast<std::size_t>(rng.index(static_cast<int>(i) + 1))]);
  }
  const Eigen::MatrixXd x = random_matrix(rng, 20, 3);
  for (const Kernel& kernel : {rbf(first_columns(3)), polynomial(first_columns(3), 2)}) {
    const GpModel model = make_model(kernel, 0.01);
    const Prediction a = predict(fit(model, data), x);
    const Prediction b = predict(fit(model, subset(data, order)), x);
    // Rounding times the condition number of the kernel matrix, 300 / 0.01.
    EXPECT_LT((a.mean - b.mean).cwiseAbs().maxCoeff(), 1e-10);
  }
}

TEST(Fit, OneSamplePredictorAgreesWithTheBatch) {
  Rng rng = Rng::from_name("predictor");
  const Dataset data = smooth_data(rng, 150, 3, 0.1);
  for (const Kernel& kernel :
       {rbf(first_columns(3)) * linear(columns({0})), polynomial(first_columns(3), 2)}) {
    const FittedGp fitted = fit(make_model(kernel, 0.01, standardise(data)), data);
    Predictor predictor(fitted);
    const Eigen::MatrixXd x = random_matrix(rng, 10, 3);
    const Prediction batch = predict(fitted, x);
    for (Eigen::Index i = 0; i < 10; ++i) {
      EXPECT_NEAR(predictor.mean(x.row(i).transpose())[0], batch.mean(i, 0), kTwoRoads);
      EXPECT_NEAR(predictor.variance()[0], batch.variance(i, 0), kTwoRoads);
    }
  }
}

TEST(Fit, SaysWhatIsWrong) {
  Rng rng = Rng::from_name("wrong");
  const GpModel model = make_model(rbf(first_columns(2)), 0.01);
  Dataset data = smooth_data(rng, 20, 2, 0.1);
  const auto message = [&](const Dataset& bad, const FitOptions& options = {}) -> std::string {
    try {
      (void)fit(model, bad, options);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  Dataset bad = data;
  bad.inputs(7, 1) = std::nan("");
  EXPECT_NE(message(bad).find("inputs row 7 column 1"), std::string::npos) << message(bad);
  bad = data;
  bad.targets.conservativeResize(19, 1);
  EXPECT_NE(message(bad).find("19 x 1 instead of 20 x 1"), std::string::npos) << message(bad);
  bad = data;
  bad.noise_scale = Eigen::MatrixXd::Zero(20, 1);
  EXPECT_NE(message(bad).find("noise_scale"), std::string::npos);
  EXPECT_NE(message(Dataset{}).find("no samples"), std::string::npos);
  const std::string memory = message(data, {.memory_limit_bytes = 1000});
  EXPECT_NE(memory.find("N = 20"), std::string::npos) << memory;
  EXPECT_NE(memory.find("fit_sparse"), std::string::npos) << memory;
}

TEST(Fit, ASingularMatrixIsReportedNotPaintedOver) {
  // The same inputs twice, and no noise to speak of.
  Rng rng = Rng::from_name("singular");
  Dataset data = smooth_data(rng, 40, 1, 0.0);
  data.inputs.bottomRows(20) = data.inputs.topRows(20);
  const GpModel model = make_model(rbf(columns({0})), 1e-30);
  try {
    (void)fit(model, data, {.max_jitter = 0.0});
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kUndetermined);
    EXPECT_NE(std::string(error.what()).find("not positive definite at sample"), std::string::npos);
  }
  const FittedGp helped = fit(model, data);
  EXPECT_GT(helped.jitter, 0.0);
  EXPECT_LE(helped.jitter, 1e-8);
}

}  // namespace
}  // namespace kinescope::gp
