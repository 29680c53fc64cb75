// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/first_order_lag.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr double kConstant_s = 0.03;

/// The steady response of constant dy/dt + y = sin(2 pi f t).
double response(double hz, double t_s) {
  const double w = 2.0 * std::numbers::pi * hz;
  const double x = w * kConstant_s;
  return (std::sin(w * t_s) - x * std::cos(w * t_s)) / (1.0 + x * x);
}

Eigen::VectorXd sine(double hz, const Eigen::VectorXd& time_s) {
  return (2.0 * std::numbers::pi * hz * time_s.array()).sin();
}

TEST(FirstOrderLag, IsTheLowPassOfASine) {
  constexpr double kRate_hz = 40.0;
  const Eigen::VectorXd time_s = Eigen::VectorXd::LinSpaced(400, 0.0, 399.0 / kRate_hz);
  const Eigen::VectorXi trajectory = Eigen::VectorXi::Zero(400);
  // Of the sine's size, at 40, 20 and 8 rows a period.
  for (const auto& [hz, tolerance] : {std::pair{1.0, 1e-3}, {2.0, 3e-3}, {5.0, 3e-2}}) {
    const Eigen::VectorXd out = first_order_lag(sine(hz, time_s), time_s, trajectory, kConstant_s);
    // The phase is 0 at the start: the odd reflection is the sine itself.
    for (Eigen::Index k = 0; k < 399; ++k)
      ASSERT_NEAR(out[k], response(hz, time_s[k]), tolerance) << hz << " Hz, row " << k;
  }
}

TEST(FirstOrderLag, OfNoTimeIsNothing) {
  const Eigen::VectorXd time_s = Eigen::VectorXd::LinSpaced(50, 0.0, 0.49);
  const Eigen::VectorXd x = sine(3.0, time_s);
  EXPECT_EQ(first_order_lag(x, time_s, Eigen::VectorXi::Zero(50), 0.0), x);
  // A step is ten thousand of these constants.
  EXPECT_LT((first_order_lag(x, time_s, Eigen::VectorXi::Zero(50), 1e-6) - x).norm(), 1e-3);
}

TEST(FirstOrderLag, StartsAnewWithATrajectoryAndBehindAGap) {
  Eigen::VectorXd time_s = Eigen::VectorXd::LinSpaced(60, 0.0, 0.59);
  time_s.tail(20).array() += 1.0;
  Eigen::VectorXi trajectory = Eigen::VectorXi::Zero(60);
  trajectory.tail(40).setOnes();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(60);
  x.segment(20, 20).setConstant(5.0);
  x.tail(20).setConstant(-2.0);
  EXPECT_LT((first_order_lag(x, time_s, trajectory, kConstant_s) - x).norm(), 1e-12);
}

}  // namespace
}  // namespace kinescope
