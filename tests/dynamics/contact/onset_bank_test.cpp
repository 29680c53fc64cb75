// SPDX-License-Identifier: Apache-2.0
//
// The recursive likelihood ratio against the same ratio written out for all samples at once.
#include "dynamics/contact/onset_bank.h"

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope::contact {
namespace {

constexpr double kStep_s = 0.01;
constexpr int kSteps = 7;

BalanceNoise one_joint(double velocity_sigma) {
  return {.velocity_sigma = Eigen::VectorXd::Constant(1, velocity_sigma),
          .torque_sigma = Eigen::VectorXd::Constant(1, 0.2),
          .model_sigma = Eigen::VectorXd::Constant(1, 0.5),
          .model_time_s = Eigen::VectorXd::Constant(1, 0.03)};
}

std::vector<BalanceSample> random_samples(Rng& rng, double mass) {
  std::vector<BalanceSample> out(kSteps + 1);
  for (int k = 0; k <= kSteps; ++k) {
    BalanceSample& sample = out[static_cast<std::size_t>(k)];
    sample.stamp_s = k * kStep_s;
    sample.momentum = Eigen::VectorXd::Constant(1, mass * rng.normal(0.01));
    sample.drive = Eigen::VectorXd::Constant(1, rng.normal());
    sample.velocity = Eigen::VectorXd::Zero(1);
    sample.mass = Eigen::MatrixXd::Constant(1, 1, mass);
    sample.sigma = Eigen::VectorXd::Ones(1);
  }
  return out;
}

/// Likelihood ratio of a torque since step `onset` (1 ..), from the covariance of all measurements.
double whole_ratio(const std::vector<BalanceSample>& samples, const BalanceNoise& noise, int onset,
                   bool grows) {
  const double mass = samples[0].mass(0, 0);
  const double decay = std::exp(-kStep_s / noise.model_time_s[0]);
  Eigen::VectorXd y(kSteps);
  Eigen::VectorXd h(kSteps);
  Eigen::MatrixXd C(kSteps, kSteps);
  double impulse = 0.0;
  // I_k = sum over steps of dt (d + white) + noise of both ends' momentum.
  const auto error_sum = [&](int a, int b) {
    double sum = 0.0;
    for (int i = 0; i < a; ++i) {
      for (int j = 0; j < b; ++j) sum += std::pow(decay, std::abs(i - j));
    }
    return sum * kStep_s * kStep_s * noise.model_sigma[0] * noise.model_sigma[0];
  };
  const double white = kStep_s * kStep_s * noise.torque_sigma[0] * noise.torque_sigma[0];
  const double ends = mass * mass * noise.velocity_sigma[0] * noise.velocity_sigma[0];
  for (int k = 1; k <= kSteps; ++k) {
    const auto& a = samples[static_cast<std::size_t>(k - 1)];
    const auto& b = samples[static_cast<std::size_t>(k)];
    impulse += 0.5 * kStep_s * (a.drive[0] + b.drive[0]);
    y[k - 1] = b.momentum[0] - samples[0].momentum[0] - impulse;
    const double acting = std::max(0, k - onset + 1);
    h[k - 1] = kStep_s * (grows ? 0.5 * acting * acting : acting);
    for (int m = 1; m <= kSteps; ++m) {
      C(k - 1, m - 1) = error_sum(k, m) + white * std::min(k, m) + ends * (k == m ? 2.0 : 1.0);
    }
  }
  const Eigen::VectorXd weighted = C.llt().solve(h);
  return std::pow(weighted.dot(y), 2) / weighted.dot(h);
}

TEST(OnsetBank, AgreesWithTheWholeCovariance) {
  Rng rng = Rng::from_name("onset_bank");
  for (const double mass : {0.0, 0.3, 2.0}) {
    const BalanceNoise noise = one_joint(0.01);
    const std::vector<BalanceSample> samples = random_samples(rng, mass);
    BalanceFilter filter(noise);
    OnsetBank bank(1, 64);
    filter.start(samples[0]);
    for (int k = 1; k <= kSteps; ++k) {
      filter.advance(samples[static_cast<std::size_t>(k)]);
      bank.advance(filter);
    }
    for (const auto& [octave, youngest, oldest] :
         {std::array{0, 1, 1}, std::array{1, 2, 3}, std::array{2, 4, 7}}) {
      double best = 0.0;
      for (int age = youngest; age <= oldest; ++age) {
        const int onset = kSteps - age + 1;
        best = std::max(best, whole_ratio(samples, noise, onset, false));
        // Of growing torques, every second onset is kept from an age of four on.
        if (age < 4 || onset % 2 == 0)
          best = std::max(best, whole_ratio(samples, noise, onset, true));
      }
      EXPECT_NEAR(bank.octave(octave).statistic, best, 1e-8 * (1.0 + best)) << mass;
    }
  }
}

}  // namespace
}  // namespace kinescope::contact
