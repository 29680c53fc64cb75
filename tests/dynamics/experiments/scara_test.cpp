// SPDX-License-Identifier: Apache-2.0
//
// Worlds of the SCARA experiment, and what is said of many runs.
#include "dynamics/experiments/scara.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "dynamics/experiments/quartiles.h"
#include "dynamics/identify/model_features.h"
#include "kinematics/core/rng.h"

namespace kinescope::experiments {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

double worst_of_first_two(Learner learner, const Misplacement& size) {
  const ComparisonCase one = scara_case(size, 0, {.samples = 400, .test_samples = 400});
  LearnOptions options{.search = {.starts = 1, .samples = 100}, .network = {}, .threads = 1};
  const ComparisonPlan plan{1, 1, {learner}, [&](int, int) { return one; }, options};
  return run_comparison(plan).front().nmse_percent.head(2).maxCoeff();
}

TEST(ScaraExperiment, MisplacementBitesWhatBelievesTheSheet) {
  const Misplacement small{0.5 * kDegree, 0.002};
  const Misplacement large{8.0 * kDegree, 0.05};
  // Gravity about axes that lean grows with the angle, its share of the torque with the square.
  EXPECT_GT(worst_of_first_two(Learner::kParametric, large),
            30.0 * worst_of_first_two(Learner::kParametric, small));
  EXPECT_LT(worst_of_first_two(Learner::kParametric, {}), 0.1);
  EXPECT_GT(worst_of_first_two(Learner::kParametric, large), 1.0);
}

// The slide's torque is linear in one acceleration: long scales and a large variance, which a range
// of 1e-4 to 1e4 does not hold.
TEST(Learners, ThreeStartsFindWhatEightFindAndNarrowRangesDoNot) {
  const ComparisonCase one = scara_case({}, 0, {.samples = 200, .test_samples = 10});
  const gp::Dataset data{
      motion_inputs(one.train.q, one.train.dq, one.train.ddq), one.train.torque.col(2), {}, {}};
  const gp::GpModel start =
      gp::make_model(gp::rbf(gp::first_columns(12)), 1e-3, gp::standardise(data));
  const gp::Estimate usual = search(start, data, {.starts = 3, .samples = 200}, 1);
  const gp::Estimate many = search(start, data, {.starts = 8, .samples = 200, .seed = 7}, 1);
  EXPECT_NEAR(usual.score, many.score, 1e-3 * 200.0);  // of the log likelihood, a sample
  // With ranges of 1e-4 to 1e4, whatever the starts.
  EXPECT_GT(usual.score, gp::estimate_hyperparameters(start, data, {.starts = 8}).score + 1.0);
}

TEST(ScaraExperiment, RunsDifferInEverythingAndSizesInGeometryAlone) {
  const ScaraOptions options{.samples = 50, .test_samples = 50};
  const ComparisonCase a = scara_case({0.01, 0.001}, 0, options);
  const ComparisonCase b = scara_case({0.05, 0.001}, 0, options);
  const ComparisonCase c = scara_case({0.01, 0.001}, 1, options);
  EXPECT_EQ(a.train.q, b.train.q);
  EXPECT_NE(a.train.torque, b.train.torque);
  EXPECT_NE(a.train.q, c.train.q);
  EXPECT_NE(a.train.q, a.test.q);
  EXPECT_EQ(first_of(a, 20).train.q, a.train.q.topRows(20));
}

TEST(ComparisonRuns, InsideIsTheShareWithinAllRanges) {
  const Eigen::MatrixXd train = (Eigen::MatrixXd(2, 2) << 0, 0, 1, 2).finished();
  const Eigen::MatrixXd test = (Eigen::MatrixXd(4, 2) << 0.5, 1, 2, 1, 0.5, 3, 1, 2).finished();
  EXPECT_DOUBLE_EQ(inside_percent(train, test), 50.0);
}

TEST(Quartiles, MedianIntervalHoldsTheMedian) {
  EXPECT_TRUE(std::isnan(median_interval({1, 2, 3, 4, 5}).lower));
  std::vector<double> twenty;
  for (int k = 1; k <= 20; ++k) twenty.push_back(k);
  EXPECT_EQ(median_interval(twenty).lower, 6.0);  // tables of the sign test: 6th and 15th of 20
  EXPECT_EQ(median_interval(twenty).upper, 15.0);
  Rng rng = Rng::from_name("median interval");
  int held = 0;
  constexpr int kDraws = 2000;
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<double> values;
    for (int k = 0; k < 20; ++k) values.push_back(std::exp(rng.normal()));
    const Interval interval = median_interval(values);
    if (interval.lower <= 1.0 && 1.0 <= interval.upper) ++held;
  }
  EXPECT_NEAR(held / static_cast<double>(kDraws), 0.959, 0.02);  // binomial; four sigma
}

}  // namespace
}  // namespace kinescope::experiments
