// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/bands.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

// Two joints: normal residuals of the claimed sigma, and ones that are three times as wide with
// heavy tails.
Eigen::MatrixXd residuals(int samples, Rng& rng) {
  Eigen::MatrixXd out(samples, 2);
  for (int i = 0; i < samples; ++i) {
    out(i, 0) = rng.normal();
    out(i, 1) = 3.0 * rng.normal() / std::sqrt(rng.uniform(0.1, 1.0));
  }
  return out;
}

double share_within(const Eigen::VectorXd& values, double width) {
  return static_cast<double>((values.array().abs() <= width).count()) /
         static_cast<double>(values.size());
}

TEST(Bands, CoverWhatTheySayWhateverTheSigmaClaims) {
  Rng rng = Rng::from_name("bands");
  const Eigen::MatrixXd seen = residuals(4000, rng);
  const Eigen::MatrixXd unseen = residuals(4000, rng);
  const BandFactors bands = bands_of(seen, Eigen::MatrixXd::Ones(4000, 2));
  // Two binomial standard deviations of both sets together: 0.0134 and 0.0097.
  for (Eigen::Index j = 0; j < 2; ++j) {
    EXPECT_NEAR(share_within(unseen.col(j), bands.width_90(j)), 0.90, 0.0134);
    EXPECT_NEAR(share_within(unseen.col(j), bands.width_95(j)), 0.95, 0.0097);
  }
  EXPECT_NEAR(bands.width_90(0), 1.645, 0.1);
  EXPECT_GT(bands.width_95(1), 3.0 * 1.96);
}

TEST(Bands, TooFewResidualsGetTheNormalDistribution) {
  Rng rng = Rng::from_name("few bands");
  const BandFactors bands = bands_of(residuals(20, rng), Eigen::MatrixXd::Ones(20, 2));
  EXPECT_NEAR(bands.width_95(1), 1.96, 1e-3);
  EXPECT_NEAR(BandFactors{}.width_90(0), 1.645, 1e-3);
  // Too short for two folds: nothing to learn from, and no error.
  TorqueSamples few;
  few.t_s = Eigen::VectorXd::LinSpaced(3, 0.0, 1.0);
  few.q = few.dq = few.ddq = few.torque = Eigen::MatrixXd::Zero(3, 1);
  few.trajectory = Eigen::VectorXi::Zero(3);
  const BandFactors none = cross_validated_bands(
      few, 5, [](const TorqueSamples&, const TorqueSamples&) { return TorquePrediction{}; });
  EXPECT_EQ(none.folds, 0);
}

// Noise drawn once a trajectory: neighbours say nothing about it, other trajectories do.
TEST(Bands, NoiseOfWholeTrajectoriesIsSeen) {
  Rng rng = Rng::from_name("offset bands");
  constexpr int kTrajectories = 40;
  constexpr int kEach = 50;
  TorqueSamples log;
  log.t_s = Eigen::VectorXd::LinSpaced(kTrajectories * kEach, 0.0, 0.01 * kTrajectories * kEach);
  log.q = Eigen::MatrixXd::Zero(log.t_s.size(), 1);
  log.trajectory = Eigen::VectorXi::Zero(log.t_s.size());
  for (Eigen::Index i = 0; i < log.t_s.size(); ++i) {
    log.q(i, 0) = rng.normal();
    log.trajectory[i] = static_cast<int>(i / kEach);
  }
  log.dq = log.ddq = log.q;
  log.torque = log.q;
  for (int k = 0; k < kTrajectories; ++k) {
    log.torque.middleRows(k * kEach, kEach).array() += rng.normal();
  }
  // A model that knows the slope and believes in a sigma of 0.1.
  const BandFactors bands =
      cross_validated_bands(log, 8, [](const TorqueSamples&, const TorqueSamples& test) {
        return TorquePrediction{test.q, Eigen::MatrixXd::Zero(test.size(), 1),
                                Eigen::MatrixXd::Constant(test.size(), 1, 0.1)};
      });
  EXPECT_EQ(bands.folds, 8);
  // 40 draws of the offset: the 90 % quantile is known to about a fifth.
  EXPECT_NEAR(bands.width_90(0), 16.4, 4.0);
}

}  // namespace
}  // namespace kinescope
