// SPDX-License-Identifier: Apache-2.0
//
// The simulated WAM: its log, what is learned of it, and the interval of the sensor's mass.
#include "dynamics/experiments/barrett.h"

#include <cmath>

#include <gtest/gtest.h>

namespace kinescope::experiments {
namespace {

double rms(const Eigen::VectorXd& error) {
  return error.norm() / std::sqrt(static_cast<double>(error.size()));
}

TEST(Barrett, LogIsFrictionGravityNoiseAndOutliers) {
  const BarrettOptions options{.samples = 1000};
  const BarrettLog log = barrett_log(wam_motions(), options.samples, options);
  const Eigen::VectorXd rest = log.measured.torque - log.clean;
  EXPECT_NEAR(static_cast<double>(log.wrong.size()), 50.0, 28.0);  // binomial, four sigma
  Eigen::VectorXd noise = rest;
  for (const int row : log.wrong) noise[row] = 0.0;
  EXPECT_NEAR(rms(noise), options.noise_nm, 4.0 * options.noise_nm / std::sqrt(2.0 * 950.0) + 2e-3);
  const Eigen::VectorXd q = log.measured.q.col(0);
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(q.size());
  const Eigen::VectorXd with = wam_torque(wam_arm(0.254), q, still, still);
  const Eigen::VectorXd without = wam_torque(wam_arm(0.0), q, still, still);
  // 0.254 kg at 0.3 + 0.06 + 0.02 m from the axis, less what the elbow's offset takes.
  EXPECT_NEAR((with - without).cwiseAbs().maxCoeff(), 0.254 * 9.81 * 0.38, 0.05);
}

TEST(Barrett, TrimmingHelpsOnUnseenMotionAndTheMassIsInItsInterval) {
  const BarrettResult result = run_barrett({.samples = 300}, 1);
  const BarrettFit& all = result.fits[0];
  const BarrettFit& trimmed = result.fits[1];
  EXPECT_EQ(result.removed, 30);
  EXPECT_LT(trimmed.unseen_rms, all.unseen_rms);
  EXPECT_LT(trimmed.in_sample_rms, trimmed.left_out_rms);
  EXPECT_LT(result.by_chunks.claimed_rms, result.by_chunks.point.block_rms);
  EXPECT_LT(result.sensor.lower_kg, 0.254);
  EXPECT_GT(result.sensor.upper_kg, 0.254);
  EXPECT_LT(result.sensor.sigma_kg, 0.05);
}

TEST(Barrett, ThreadsChangeNothing) {
  const BarrettResult one = run_barrett({.samples = 150}, 1);
  const BarrettResult two = run_barrett({.samples = 150}, 2);
  EXPECT_EQ(one.sensor.kg, two.sensor.kg);
  EXPECT_EQ(one.fits[3].unseen_rms, two.fits[3].unseen_rms);
  EXPECT_EQ(one.grid.back().block_rms, two.grid.back().block_rms);
}

}  // namespace
}  // namespace kinescope::experiments
