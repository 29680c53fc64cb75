// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/bands.h"

#include <cmath>
#include <limits>

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

LeftOutTorques left_out(const Eigen::MatrixXd& residual) {
  LeftOutTorques out;
  out.residual = residual;
  out.sigma = Eigen::MatrixXd::Ones(residual.rows(), residual.cols());
  out.model_sigma = Eigen::MatrixXd::Zero(residual.rows(), residual.cols());
  out.fold = Eigen::VectorXi::Zero(residual.rows());
  out.folds = 1;
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
  const BandFactors bands = bands_of(left_out(seen));
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
  const BandFactors bands = bands_of(left_out(residuals(20, rng)));
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

// Noise drawn once a trajectory: neighbours say nothing about it, other trajectories do. Over many
// draws, bands cover an unseen trajectory as often as they say, though each is made from few.
TEST(Bands, CoverNoiseOfWholeTrajectoriesOverManyDraws) {
  Rng rng = Rng::from_name("offset bands");
  constexpr int kDraws = 300;
  constexpr int kTrajectories = 8;
  constexpr int kEach = 40;
  constexpr double kOffset = 2.0;  // sigma of the offset; of the noise about it: 1
  TorqueSamples log;
  log.t_s = Eigen::VectorXd::LinSpaced(kTrajectories * kEach, 0.0, 0.01 * kTrajectories * kEach);
  log.q.resize(log.t_s.size(), 1);
  log.trajectory.resize(log.t_s.size());
  double covered_90 = 0.0;
  double covered_95 = 0.0;
  for (int draw = 0; draw < kDraws; ++draw) {
    for (int k = 0; k < kTrajectories; ++k) {
      for (int i = k * kEach; i < (k + 1) * kEach; ++i) {
        log.q(i, 0) = rng.normal();
        log.trajectory[i] = k;
      }
    }
    log.dq = log.ddq = log.torque = log.q;
    for (int k = 0; k < kTrajectories; ++k) {
      const double offset = rng.normal(kOffset);
      for (int i = k * kEach; i < (k + 1) * kEach; ++i) log.torque(i, 0) += offset + rng.normal();
    }
    // A model that knows the slope and believes in a sigma of 0.1.
    const BandFactors bands =
        cross_validated_bands(log, 8, [](const TorqueSamples&, const TorqueSamples& test) {
          return TorquePrediction{test.q, Eigen::MatrixXd::Zero(test.size(), 1),
                                  Eigen::MatrixXd::Constant(test.size(), 1, 0.1)};
        });
    ASSERT_EQ(bands.folds, 8);
    const double sigma = std::sqrt(1.0 + kOffset * kOffset) / 0.1;
    covered_90 += std::erf(bands.width_90(0) / sigma / std::sqrt(2.0)) / kDraws;
    covered_95 += std::erf(bands.width_95(0) / sigma / std::sqrt(2.0)) / kDraws;
  }
  // What the command promises; the draws' own scatter is below 0.5 %. Without the widening by the
  // jackknife: 0.886 and 0.922.
  EXPECT_NEAR(covered_90, 0.90, 0.02);
  EXPECT_NEAR(covered_95, 0.95, 0.02);
}

// A variance that is half the claimed function's, on top of noise that the model does not know of.
TEST(Bands, SigmaIsMadeOfThePartsThatResidualsHave) {
  Rng rng = Rng::from_name("parts of sigma");
  constexpr int kSamples = 4000;
  constexpr double kFactor = 0.5;
  constexpr double kNoiseSigma = 0.3;
  LeftOutTorques left = left_out(Eigen::MatrixXd::Zero(kSamples, 1));
  for (int i = 0; i < kSamples; ++i) {
    left.model_sigma(i, 0) = rng.uniform(0.1, 3.0);
    left.residual(i, 0) = rng.normal(std::hypot(kFactor * left.model_sigma(i, 0), kNoiseSigma));
  }
  const SigmaParts parts = sigma_parts_of(left);
  // 4000 samples give a sigma to 1 %; its parts share them.
  EXPECT_NEAR(parts.model_factor[0], kFactor, 0.04);
  EXPECT_NEAR(parts.noise_sigma[0], kNoiseSigma, 0.06);
  const TorquePrediction p = with_sigma_parts({left.residual, left.model_sigma, left.sigma}, parts);
  EXPECT_NEAR(p.sigma(7, 0), std::hypot(kFactor * left.model_sigma(7, 0), kNoiseSigma),
              0.1 * p.sigma(7, 0));
  EXPECT_DOUBLE_EQ(p.model_sigma(7, 0), parts.model_factor[0] * left.model_sigma(7, 0));
  EXPECT_EQ(p.mean, left.residual);
}

TEST(Bands, AModelSureOfItselfGetsTheNoiseThatIsThere) {
  Rng rng = Rng::from_name("sure of itself");
  const LeftOutTorques left = left_out(residuals(4000, rng));
  const SigmaParts parts = sigma_parts_of(left);
  EXPECT_EQ(parts.model_factor[0], 0.0);
  EXPECT_NEAR(parts.noise_sigma[0], 1.0, 0.05);
}

// A residual over an infinite sigma is 0, however wrong the model was.
TEST(Bands, AnInfiniteSigmaSaysNothing) {
  Rng rng = Rng::from_name("infinite sigma");
  const LeftOutTorques finite = left_out(residuals(300, rng));
  LeftOutTorques both = left_out(residuals(900, rng));
  both.residual.topRows(300) = finite.residual;
  both.sigma.bottomRows(600).setConstant(std::numeric_limits<double>::infinity());
  both.model_sigma = both.sigma;
  const BandFactors bands = bands_of(both);
  EXPECT_EQ(bands.of_95, bands_of(finite).of_95);
  EXPECT_EQ(bands.residuals, Eigen::Vector2i(300, 300));
  EXPECT_EQ(bands.skipped, Eigen::Vector2i(600, 600));
  const SigmaParts parts = sigma_parts_of(both);
  EXPECT_NEAR(parts.model_factor[1], 0.0, 1e-12 + parts.noise_sigma[1]);
  EXPECT_TRUE(std::isfinite(parts.noise_sigma[0]));
  EXPECT_GT(parts.noise_sigma[1], 1.0);
  EXPECT_TRUE(std::isinf(
      with_sigma_parts({both.residual, both.model_sigma, both.sigma}, parts).sigma(899, 0)));
  // Too few are left: the normal distribution's, and that is said.
  both.sigma.topRows(280).setConstant(std::numeric_limits<double>::infinity());
  const BandFactors few = bands_of(both);
  EXPECT_EQ(few.residuals, Eigen::Vector2i(0, 0));
  EXPECT_EQ(few.skipped, Eigen::Vector2i(880, 880));
  EXPECT_NEAR(few.width_95(1), 1.96, 1e-3);
}

// One fold of five is where the model doubts itself and errs: without it sigma has other parts.
TEST(Bands, TheJackknifeFindsThePartsAnew) {
  Rng rng = Rng::from_name("parts anew");
  constexpr int kEach = 100;
  LeftOutTorques left = left_out(Eigen::MatrixXd::Zero(5 * kEach, 1));
  left.folds = 5;
  for (int i = 0; i < 5 * kEach; ++i) {
    left.fold[i] = i / kEach;
    left.model_sigma(i, 0) = left.fold[i] == 0 ? rng.uniform(1.0, 5.0) : rng.uniform(0.1, 2.0);
    left.residual(i, 0) = rng.normal(left.fold[i] == 0 ? left.model_sigma(i, 0) : 0.5);
  }
  const CalibratedSigma found = calibrate(left);
  LeftOutTorques fixed = left;
  fixed.sigma = with_sigma_parts({left.residual, left.model_sigma, left.sigma}, found.parts).sigma;
  EXPECT_GT(found.bands.of_95[0], 1.02 * bands_of(fixed).of_95[0]);
}

}  // namespace
}  // namespace kinescope
