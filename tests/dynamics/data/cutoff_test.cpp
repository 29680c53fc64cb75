// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/cutoff.h"

#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/data/spectrum.h"
#include "kinematics/core/rng.h"
#include "kinematics/log/smoothing_spline.h"
#include "tests/dynamics/data/log_world.h"

namespace kinescope {
namespace {

constexpr double kStepS = 0.005;
constexpr double kSideLobes = 3.0;  // the sharp edge of the motion, seen through the window

/// A band-limited motion and its second derivative.
struct Signal {
  Eigen::VectorXd t, x, second;
};

Signal band_limited(double highest_hz, double duration_s, const std::string& name) {
  Rng rng = Rng::from_name(name);
  Signal out;
  out.t = Eigen::VectorXd::LinSpaced(static_cast<Eigen::Index>(duration_s / kStepS), 0.0,
                                     duration_s - kStepS);
  out.x = Eigen::VectorXd::Zero(out.t.size());
  out.second = out.x;
  for (int k = 0; k < 40; ++k) {
    const double w = kTurn * highest_hz * std::sqrt(rng.uniform(0.01, 1.0));
    const double a = rng.uniform(0.5, 1.0) / (w * w);
    const Eigen::ArrayXd phase = w * out.t.array() + rng.uniform(0.0, kTurn);
    out.x += a * phase.sin().matrix();
    out.second -= a * w * w * phase.sin().matrix();
  }
  return out;
}

Eigen::VectorXd with_noise(Eigen::VectorXd x, double sigma, const std::string& name) {
  Rng rng = Rng::from_name(name);
  for (double& value : x) value += rng.normal(sigma);
  return x;
}

CutoffChoice choose(const Eigen::VectorXd& x) {
  const CutoffEvidence evidence{
      {power_spectrum({kStepS, {x}}, 1)}, 2, {}, Eigen::VectorXd::Ones(1)};
  return choose_cutoff(evidence, 3);
}

double acceleration_error(const Signal& signal, const Eigen::VectorXd& measured, double cutoff_hz) {
  const Eigen::Index edge = signal.t.size() / 10;
  const Eigen::Index n = signal.t.size() - 2 * edge;
  const Eigen::VectorXd found =
      SmoothingSpline(signal.t, measured, cutoff_hz).evaluate(signal.t, 2);
  return (found - signal.second).segment(edge, n).norm() / signal.second.segment(edge, n).norm();
}

TEST(Spectrum, OfWhiteNoiseIsFlatAndOfItsPower) {
  constexpr double kSigma = 0.3;
  const Eigen::VectorXd x = with_noise(Eigen::VectorXd::Zero(40000), kSigma, "Spectrum.white");
  for (const int differences : {0, 1, 2}) {
    const Spectrum spectrum = power_spectrum({kStepS, {x}}, differences);
    const double expected = 2.0 * kSigma * kSigma * kStepS;
    const Eigen::Index n = spectrum.power.size();
    EXPECT_NEAR(spectrum.power.segment(n / 4, n / 2).mean(), expected, 0.05 * expected);
    EXPECT_NEAR(spectrum.frequency_hz(n - 1), 0.5 / kStepS, 1e-9);
  }
}

TEST(Spectrum, FindsWhereTheMotionEnds) {
  for (const double hz : {1.0, 2.0, 5.0}) {
    const Signal signal = band_limited(hz, 60.0, "Spectrum.end");
    const Spectrum spectrum = power_spectrum({kStepS, {with_noise(signal.x, 1e-5, "n")}}, 1);
    const MotionAndNoise parts = separate(spectrum, 1);
    EXPECT_GT(parts.end_hz, 0.9 * hz);
    EXPECT_LT(parts.end_hz, kSideLobes * hz);
    EXPECT_LT((parts.motion + parts.noise - spectrum.power).cwiseAbs().maxCoeff(),
              1e-12 * spectrum.power.maxCoeff());
  }
}

TEST(Spectrum, AVibrationBehindAValleyIsNoMotion) {
  Signal signal = band_limited(1.0, 60.0, "Spectrum.vibration");
  signal.x += 1e-4 * (kTurn * 15.0 * signal.t.array()).sin().matrix();
  const Spectrum spectrum = power_spectrum({kStepS, {with_noise(signal.x, 1e-5, "n")}}, 1);
  EXPECT_LT(separate(spectrum, 1).end_hz, kSideLobes);
}

TEST(Cutoff, IsNearTheBestOneAndPromisesWhatComes) {
  // Against the cut-off that an exact truth would choose.
  for (const double sigma : {1e-5, 1e-4, 1e-3}) {
    const Signal signal = band_limited(2.0, 60.0, "Cutoff.best");
    const Eigen::VectorXd measured = with_noise(signal.x, sigma, "Cutoff.noise");
    const CutoffChoice choice = choose(measured);
    double best = 1e9;
    for (double hz = 0.5; hz < 40.0; hz *= 1.05)
      best = std::min(best, acceleration_error(signal, measured, hz));
    const double error = acceleration_error(signal, measured, choice.cutoff_hz);
    EXPECT_LT(error, 1.25 * best) << "sigma " << sigma << ", cut-off " << choice.cutoff_hz;
    EXPECT_NEAR(choice.expected_error(0) / error, 1.0, 0.35);
    EXPECT_TRUE(choice.chosen);
    EXPECT_FALSE(choice.at_edge);
  }
}

TEST(Cutoff, FallsWithNoiseAndRisesWithTheBand) {
  const auto chosen = [](double band_hz, double sigma) {
    const Signal signal = band_limited(band_hz, 60.0, "Cutoff.order");
    return choose(with_noise(signal.x, sigma, "Cutoff.noise")).cutoff_hz;
  };
  EXPECT_GT(chosen(2.0, 1e-6), chosen(2.0, 1e-4));
  EXPECT_GT(chosen(5.0, 1e-5), chosen(1.0, 1e-5));
}

// A sweep at constant speed: the velocity's spectrum is noise, the joint moves all the same.
TEST(Cutoff, ASteadyTravelIsAMotion) {
  constexpr double kDuration = 30.0;  // s
  constexpr double kSpeed = 0.0175;   // rad/s: a degree a second
  constexpr double kNoise = 3e-5;     // rad
  const auto n = static_cast<Eigen::Index>(kDuration / kStepS);
  const Eigen::VectorXd way = Eigen::VectorXd::LinSpaced(n, 0.0, kSpeed * kDuration);
  const auto chosen_at = [&](double noise) {
    const Eigen::VectorXd x = with_noise(way, noise, "steady travel");
    return choose_cutoff({{power_spectrum({kStepS, {x}}, 1)},
                          2,
                          {},
                          Eigen::VectorXd::Ones(1),
                          Eigen::VectorXd::Constant(1, kSpeed),
                          kDuration},
                         3);
  };
  EXPECT_FALSE(choose(with_noise(way, kNoise, "steady travel")).chosen) << "without its travel";
  const CutoffChoice choice = chosen_at(kNoise);
  ASSERT_TRUE(choice.chosen);
  EXPECT_FALSE(choice.at_edge);
  // Where 4 v^2 / (w^2 T) is 2.5 times the noise's 2 sigma^2 dt w^2, within a third of an octave.
  const double crossing_hz =
      std::pow(4.0 * kSpeed * kSpeed / (2.5 * kDuration * 2.0 * kNoise * kNoise * kStepS), 0.25) /
      kTurn;
  EXPECT_NEAR(choice.motion_end_hz(0) / crossing_hz, 1.0, 0.26);
  EXPECT_LT(chosen_at(10.0 * kNoise).cutoff_hz, choice.cutoff_hz);
}

TEST(Cutoff, IsNotChosenWhereNothingMoves) {
  const CutoffChoice choice = choose(with_noise(Eigen::VectorXd::Zero(8000), 1e-3, "Cutoff.still"));
  EXPECT_FALSE(choice.chosen);
  EXPECT_EQ(choice.cutoff_hz, 0.0);
}

}  // namespace
}  // namespace kinescope
