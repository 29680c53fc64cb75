// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/tail.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

/// Independent values, far enough apart to be clusters of their own.
StatisticRecord record_of(int count, double shape, Rng& rng) {
  StatisticRecord record{.values = {}, .step_s = 1.0, .cluster_gap_s = 0.5};
  for (int i = 0; i < count; ++i) {
    const double u = 1.0 - rng.uniform();
    record.values.push_back(shape == 0.0 ? -std::log(u) : (std::pow(u, -shape) - 1.0) / shape);
    record.values.push_back(0.0);  // one cluster each
  }
  return record;
}

/// Exceeding once in a hundred times the record: the median over records is right within a quarter
/// and, since the quantile is predictive, not below the truth.
TEST(Tail, ExtrapolatesAnExponentialTail) {
  Rng rng = Rng::from_name("tail.exponential");
  const double truth = std::log(2000.0 * 100.0);
  double passed = 0.0;
  constexpr int kRecords = 200;
  for (int i = 0; i < kRecords; ++i) {
    const TailFit fit = fit_tail(record_of(2000, 0.0, rng));
    passed += std::exp(-fit.quantile(1.0 / (2000.0 * 2.0 * 100.0)) + truth);
  }
  // Mean rate of the estimated thresholds in units of the wanted rate.
  EXPECT_LT(passed / kRecords, 1.6);
  EXPECT_GT(passed / kRecords, 0.1);
}

TEST(Tail, SeesAHeavyTail) {
  Rng rng = Rng::from_name("tail.heavy");
  double shape = 0.0;
  for (int i = 0; i < 50; ++i) shape += fit_tail(record_of(20000, 0.4, rng)).own_shape / 50.0;
  EXPECT_NEAR(shape, 0.4, 0.1);
}

TEST(Tail, RateIsTheInverseOfQuantile) {
  Rng rng = Rng::from_name("tail.inverse");
  const TailFit fit = fit_tail(record_of(1000, 0.0, rng));
  for (const double rate : {1e-2, 1e-4, 1e-8}) {
    EXPECT_NEAR(fit.rate_above(fit.quantile(rate)) / rate, 1.0, 1e-9);
  }
}

TEST(Tail, RefusesARecordWithoutPeaks) {
  Rng rng = Rng::from_name("tail.short");
  EXPECT_THROW((void)fit_tail(record_of(8, 0.0, rng)), Error);
  EXPECT_THROW((void)fit_tail({.values = {}, .step_s = 1.0}), Error);
}

}  // namespace
}  // namespace kinescope
