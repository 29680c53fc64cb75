// SPDX-License-Identifier: Apache-2.0
//
// Is the claimed uncertainty true? Functions drawn from the prior itself, 200 seeds.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/gp/leave_out.h"
#include "dynamics/gp/lip_kernel.h"
#include "dynamics/gp/sparse.h"
#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {

constexpr int kSeeds = 200;
// Kolmogorov-Smirnov distance of 200 uniform numbers: 0.138 is passed once in 1000.
constexpr double kLargestDistance = 0.138;

// Largest distance between the share of values below u and u.
double distance_to_uniform(std::vector<double> values) {
  std::ranges::sort(values);
  double worst = 0.0;
  const auto n = static_cast<double>(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto k = static_cast<double>(i);
    worst = std::max({worst, std::abs(values[i] - k / n), std::abs(values[i] - (k + 1.0) / n)});
  }
  return worst;
}

// Chi-square with one degree of freedom.
double chi_square_share(double z) { return std::erf(std::abs(z) / std::sqrt(2.0)); }

struct Shares {
  std::vector<double> function;
  std::vector<double> measurement;
};

// The last sample is not in the fit.
Shares shares_of(const Kernel& kernel, int columns, Route route, std::string_view name) {
  Shares out;
  for (int seed = 0; seed < kSeeds; ++seed) {
    Rng rng = Rng::from_name(name, static_cast<std::uint64_t>(seed));
    const GpModel model = make_model(kernel, 0.05, {}, true);
    const Eigen::MatrixXd inputs = random_matrix(rng, 31, columns);
    Eigen::VectorXd function;
    const Dataset all = drawn_data(rng, model, inputs, &function);
    std::vector<Eigen::Index> seen(30);
    for (Eigen::Index i = 0; i < 30; ++i) seen[static_cast<std::size_t>(i)] = i;
    const FittedGp fitted = fit(model, subset(all, seen), {.route = route, .threads = 1});
    const Prediction at = predict(fitted, inputs.bottomRows(1), {.threads = 1});
    const int outputs = kernel.outputs();
    const Eigen::Index o = seed % outputs;
    out.function.push_back(chi_square_share((function[30 * outputs + o] - at.mean(0, o)) /
                                            std::sqrt(at.variance(0, o))));
    out.measurement.push_back(
        chi_square_share((all.targets(30, o) - at.mean(0, o)) /
                         std::sqrt(at.variance(0, o) + at.noise_variance[o])));
  }
  return out;
}

void expect_uniform(const Shares& shares) {
  EXPECT_LT(distance_to_uniform(shares.function), kLargestDistance);
  EXPECT_LT(distance_to_uniform(shares.measurement), kLargestDistance);
}

TEST(Coverage, SquaredExponential) {
  expect_uniform(shares_of(rbf(first_columns(2)), 2, Route::kDense, "coverage rbf"));
}

TEST(Coverage, FeatureSpace) {
  expect_uniform(shares_of(polynomial(first_columns(2), 2), 2, Route::kFeatures, "coverage poly"));
}

TEST(Coverage, AllTorquesTogether) {
  const JointKinds joints = {JointKind::kRevolute, JointKind::kPrismatic};
  expect_uniform(shares_of(lip(joints), 6, Route::kDense, "coverage lip"));
}

TEST(Coverage, LeaveOneOut) {
  std::vector<double> shares;
  for (int seed = 0; seed < kSeeds; ++seed) {
    Rng rng = Rng::from_name("coverage loo", static_cast<std::uint64_t>(seed));
    const GpModel model = make_model(rbf(first_columns(2)), 0.05);
    const Dataset data = drawn_data(rng, model, random_matrix(rng, 30, 2));
    const LeaveOut left = leave_one_out(fit(model, data, {.threads = 1}), data, 1);
    shares.push_back(chi_square_share(left.z(seed % 30, 0)));
  }
  EXPECT_LT(distance_to_uniform(shares), kLargestDistance);
}

// The test itself can fail: sigmas that are a third too small.
TEST(Coverage, WouldSeeASigmaThatIsTooSmall) {
  std::vector<double> shares;
  Rng rng = Rng::from_name("coverage wrong");
  for (int seed = 0; seed < kSeeds; ++seed) shares.push_back(chi_square_share(1.5 * rng.normal()));
  EXPECT_GT(distance_to_uniform(shares), kLargestDistance);
}

}  // namespace
}  // namespace kinescope::gp
