// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>

#include <Eigen/QR>
#include <gtest/gtest.h>

#include "dynamics/data/cutoff.h"
#include "dynamics/data/zero_phase_filter.h"
#include "kinematics/core/rng.h"
#include "kinematics/log/smoothing_spline.h"
#include "tests/dynamics/data/log_world.h"

namespace kinescope {
namespace {

Eigen::VectorXd even_times(double duration_s, double rate_hz) {
  const auto n = static_cast<Eigen::Index>(std::lround(duration_s * rate_hz)) + 1;
  return Eigen::VectorXd::LinSpaced(n, 0.0, duration_s);
}

Eigen::VectorXd wave(const Eigen::VectorXd& t, double hz) { return (kTurn * hz * t).array().sin(); }

/// Gain on a sine in the middle of the data, by projection on sine and cosine; phase in rad.
struct Gain {
  double size, phase;
};
Gain gain_of(const Eigen::VectorXd& t, const Eigen::VectorXd& y, double hz) {
  const Eigen::Index n = t.size();
  const Eigen::Index from = n / 4;
  const Eigen::Index count = n / 2;
  Eigen::MatrixXd basis(count, 2);
  basis.col(0) = (kTurn * hz * t.segment(from, count)).array().sin();
  basis.col(1) = (kTurn * hz * t.segment(from, count)).array().cos();
  const Eigen::Vector2d c = basis.colPivHouseholderQr().solve(y.segment(from, count));
  return {c.norm(), std::atan2(c(1), c(0))};
}

TEST(ZeroPhaseFilter, HasTheStatedResponseAndNoPhase) {
  const Eigen::VectorXd t = even_times(20.0, 500.0);
  // The bilinear transform bends frequencies: 1 % at 30 Hz of 500.
  constexpr double kWarping = 0.01;
  for (const int order : {1, 2, 3, 4, 5}) {
    for (const double hz : {1.0, 5.0, 10.0, 20.0, 30.0}) {
      const Gain gain = gain_of(t, filter_zero_phase(wave(t, hz), order, 10.0, 500.0), hz);
      EXPECT_NEAR(gain.size, filter_response(hz, 10.0, order), kWarping) << order << " at " << hz;
      EXPECT_NEAR(gain.phase, 0.0, 1e-6 / gain.size);
    }
  }
  EXPECT_NEAR(filter_response(10.0, 10.0, 4), std::numbers::sqrt2 / 2.0, 1e-15)
      << "-3 dB at the cut-off";
}

TEST(ZeroPhaseFilter, LeavesLinesAloneUpToTheirEnds) {
  const Eigen::VectorXd t = even_times(5.0, 100.0);
  const Eigen::VectorXd line = (3.0 - 2.0 * t.array()).matrix();
  EXPECT_LT((filter_zero_phase(line, 4, 3.0, 100.0) - line).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(ZeroPhaseFilter, SectionsAreStableAndOfGainOne) {
  for (int order = 1; order <= 8; ++order) {
    for (const double cutoff : {0.1, 5.0, 45.0}) {
      for (const FilterSection& s : butterworth(order, cutoff, 100.0)) {
        EXPECT_NEAR((s.b0 + s.b1 + s.b2) / (1.0 + s.a1 + s.a2), 1.0, 1e-6);
        EXPECT_LT(std::abs(s.a2), 1.0);
        EXPECT_LT(std::abs(s.a1), 1.0 + s.a2);
      }
    }
  }
}

TEST(CentralDifferences, AreOfEighthOrder) {
  const auto worst = [](double rate_hz) {
    const Eigen::VectorXd t = even_times(4.0, rate_hz);
    const Eigen::VectorXd found = central_differences(wave(t, 1.0), 1.0 / rate_hz);
    const Eigen::VectorXd exact = kTurn * (kTurn * t).array().cos();
    const Eigen::Index n = t.size();
    return (found - exact).segment(4, n - 8).cwiseAbs().maxCoeff();
  };
  const double ratio = worst(20.0) / worst(40.0);
  EXPECT_GT(ratio, 200.0);  // 2^8 = 256
  EXPECT_LT(ratio, 300.0);
}

TEST(SmoothingSpline, IsExactOnParabolasAlsoAtTheEndsAndUneven) {
  // The penalty is the third derivative, so parabolas cost nothing.
  Rng rng = Rng::from_name("SmoothingSpline.parabola");
  Eigen::VectorXd t(400);
  for (Eigen::Index k = 0; k < t.size(); ++k)
    t(k) = 0.01 * static_cast<double>(k) + rng.uniform(0.0, 0.008);
  const Eigen::VectorXd y = (1.0 - 2.0 * t.array() + 3.0 * t.array().square()).matrix();
  const SmoothingSpline spline(t, y, 2.0);
  constexpr double kExact = 1e-8;  // the normal equations square the condition
  EXPECT_LT((spline.evaluate(t) - y).cwiseAbs().maxCoeff(), kExact);
  const Eigen::VectorXd rate = (-2.0 + 6.0 * t.array()).matrix();
  EXPECT_LT((spline.evaluate(t, 1) - rate).cwiseAbs().maxCoeff(), 100 * kExact);
  EXPECT_LT((spline.evaluate(t, 2).array() - 6.0).abs().maxCoeff(), 1e4 * kExact);
}

TEST(SmoothingSpline, HasTheResponseOfAThirdOrderButterworthTwice) {
  const Eigen::VectorXd t = even_times(20.0, 500.0);
  constexpr double kKnots = 2e-3;  // the basis has six knots a period of the cut-off
  for (const double hz : {1.0, 3.0, 5.0, 7.0, 10.0}) {
    const Gain gain = gain_of(t, SmoothingSpline(t, wave(t, hz), 5.0).evaluate(t), hz);
    EXPECT_NEAR(gain.size, filter_response(hz, 5.0, 3), kKnots) << hz;
    EXPECT_NEAR(gain.phase, 0.0, 1e-3);
  }
}

TEST(SmoothingSpline, AgreesWithTheFilterOnNoise) {
  // Two roads to one number: penalised least squares and a recursive filter.
  Rng rng = Rng::from_name("SmoothingSpline.noise");
  const Eigen::VectorXd t = even_times(10.0, 400.0);
  Eigen::VectorXd y(t.size());
  for (Eigen::Index k = 0; k < y.size(); ++k) y(k) = rng.normal();
  const Eigen::VectorXd spline = SmoothingSpline(t, y, 4.0).evaluate(t);
  const Eigen::VectorXd filter = filter_zero_phase(y, 3, 4.0, 400.0);
  const Eigen::Index edge = 400;  // four periods
  const Eigen::VectorXd inner = filter.segment(edge, t.size() - 2 * edge);
  const double difference = (spline.segment(edge, inner.size()) - inner).norm() / inner.norm();
  EXPECT_LT(difference, 0.02);
}

TEST(SmoothingSpline, ItsCutOffDoesNotDependOnTheDensityOfSamples) {
  // Every tenth sample only in the second half of the time.
  std::vector<double> stamps;
  for (int k = 0; k <= 5000; ++k) {
    if (k < 2500 || k % 10 == 0) stamps.push_back(0.004 * k);
  }
  const Eigen::VectorXd t =
      Eigen::Map<const Eigen::VectorXd>(stamps.data(), static_cast<Eigen::Index>(stamps.size()));
  const SmoothingSpline spline(t, wave(t, 2.0), 2.0);
  const Eigen::VectorXd dense = Eigen::VectorXd::LinSpaced(1000, 2.0, 8.0);
  const Eigen::VectorXd sparse = Eigen::VectorXd::LinSpaced(1000, 12.0, 18.0);
  const double expected = filter_response(2.0, 2.0, 3);
  EXPECT_NEAR(gain_of(dense, spline.evaluate(dense), 2.0).size, expected, 0.06);
  EXPECT_NEAR(gain_of(sparse, spline.evaluate(sparse), 2.0).size, expected, 0.06);
}

}  // namespace
}  // namespace kinescope
