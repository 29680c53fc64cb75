// SPDX-License-Identifier: Apache-2.0
//
// The claimed covariance against the scatter over many noises of one motion.
#include <algorithm>

#include <gtest/gtest.h>

#include "dynamics/identify/identify.h"
#include "dynamics/identify/prediction.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

struct Coverage {
  double share = 0.0;         ///< of parameters within their 95 % interval
  double white_share = 0.0;   ///< the same for the covariance of white noise
  double spread_ratio = 0.0;  ///< median of claimed over measured sigma
};

constexpr int kSeeds = 200;

/// 97.5 % point of Student's t, Abramowitz and Stegun 26.7.5.
double student_quantile(double freedom) {
  constexpr double kX = 1.959964;
  return kX + (kX * kX * kX + kX) / (4.0 * freedom) +
         (5.0 * std::pow(kX, 5) + 16.0 * kX * kX * kX + 3.0 * kX) / (96.0 * freedom * freedom);
}

Coverage measure(const TorqueWorldOptions& world, RobustLoss loss) {
  Rng rng = Rng::from_name("Coverage.arm");
  const DynamicModel model = random_masses(
      random_robot({.joints = 3, .prismatic_share = 0.0}, rng).tree, {.motors = true}, rng);
  const std::uint64_t motion_seed = 5;
  Rng quiet(motion_seed);
  TorqueWorldOptions without = world;
  without.noise = 0.0;
  const TorqueSamples clean = torque_log_of(model, without, quiet);
  const Eigen::VectorXd truth =
      identify_dynamics(model, clean, {.loss = RobustLoss::kNone}).parameters;
  Coverage out;
  Eigen::MatrixXd errors(truth.size(), kSeeds);
  Eigen::MatrixXd claimed(truth.size(), kSeeds);
  for (int seed = 0; seed < kSeeds; ++seed) {
    Rng noise = Rng::from_name("Coverage.noise", static_cast<std::uint64_t>(seed));
    TorqueSamples log = clean;
    const double rate = world.noise;
    for (Eigen::Index j = 0; j < 3; ++j) {
      const double rms =
          clean.torque.col(j).norm() / std::sqrt(static_cast<double>(clean.torque.rows()));
      double state = noise.normal();
      for (Eigen::Index t = 0; t < clean.torque.rows(); ++t) {
        state = world.noise_memory * state +
                std::sqrt(1.0 - world.noise_memory * world.noise_memory) * noise.normal();
        log.torque(t, j) += rate * rms * state;
      }
    }
    const Identification fit = identify_dynamics(model, log, {.loss = loss});
    const Eigen::ArrayXd error = (fit.parameters - truth).array().abs();
    errors.col(seed) = fit.parameters - truth;
    claimed.col(seed) = fit.covariance.diagonal().cwiseSqrt();
    const double point = student_quantile(fit.blocks - 1);
    out.share += (error <= point * claimed.col(seed).array()).cast<double>().mean() / kSeeds;
    out.white_share +=
        (error <= 1.96 * fit.white_covariance.diagonal().array().sqrt()).cast<double>().mean() /
        kSeeds;
  }
  const Eigen::ArrayXd spread = (errors.array().square().rowwise().mean()).sqrt();
  const Eigen::ArrayXd ratios = claimed.rowwise().mean().array() / spread;
  std::vector<double> sorted(ratios.begin(), ratios.end());
  std::ranges::sort(sorted);
  out.spread_ratio = sorted[sorted.size() / 2];
  return out;
}

// 200 seeds x about 20 correlated parameters: the share's own sigma is about 0.7 %.
constexpr double kLowest = 0.93;
constexpr double kHighest = 0.975;

TEST(Coverage, WhiteNoise) {
  const Coverage c = measure({.noise = 0.02}, RobustLoss::kNone);
  RecordProperty("share", std::to_string(c.share));
  EXPECT_GT(c.share, kLowest);
  EXPECT_LT(c.share, kHighest);
  EXPECT_GT(c.white_share, kLowest);
  EXPECT_LT(c.white_share, kHighest);
}

TEST(Coverage, ColouredNoise) {
  // Correlation time of about 12 samples: the white sigma is too small by a factor of three.
  const Coverage c =
      measure({.samples = 6000, .noise = 0.02, .noise_memory = 0.85}, RobustLoss::kNone);
  RecordProperty("share", std::to_string(c.share));
  EXPECT_GT(c.share, kLowest);
  EXPECT_LT(c.share, kHighest);
  EXPECT_NEAR(c.spread_ratio, 1.0, 0.12);
  EXPECT_LT(c.white_share, 0.8);
}

TEST(Coverage, ColouredNoiseRobustly) {
  const Coverage c =
      measure({.samples = 6000, .noise = 0.02, .noise_memory = 0.85}, RobustLoss::kHuber);
  EXPECT_GT(c.share, kLowest);
  EXPECT_LT(c.share, kHighest);
}

}  // namespace
}  // namespace kinescope
