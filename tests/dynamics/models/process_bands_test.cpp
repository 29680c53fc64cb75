// SPDX-License-Identifier: Apache-2.0
//
// Bands of Gaussian processes against scatter: many small arms, each with noise that has a memory,
// judged on trajectories that the fit has not seen.
#include <gtest/gtest.h>

#include "dynamics/data/splits.h"
#include "dynamics/models/comparison.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

struct Share {
  double of_90 = 0.0;
  double of_95 = 0.0;
};

// Mean share of unseen torques within the bands, over arms of one joint.
Share mean_share(TorqueModelKind kind, int arms, int band_folds) {
  Share out;
  for (int k = 0; k < arms; ++k) {
    Rng rng = Rng::from_name("bands of processes", static_cast<std::uint64_t>(k));
    const RandomRobot robot = random_robot({.joints = 1, .prismatic_share = 0.0}, rng);
    const DynamicModel model = random_masses(robot.tree, {}, rng);
    const TorqueSamples all = torque_log_of(
        model,
        {.samples = 480, .rate_hz = 25.0, .noise = 0.1, .noise_memory = 0.9, .trajectories = 8},
        rng);
    const Fold fold = split_last(all, 0.24);
    TorqueModelOptions options;
    options.samples = 180;
    options.hyperparameter_samples = 120;
    options.starts = 1;
    options.threads = 1;
    options.band_folds = band_folds;
    const FittedTorqueModel fitted =
        fit_torque_model(kind, model, select_rows(all, fold.train), options);
    const TorqueScore score = score_torque_model(fitted, select_rows(all, fold.test));
    out.of_90 += score.coverage_90.mean() / arms;
    out.of_95 += score.coverage_95.mean() / arms;
  }
  return out;
}

// Claimed sigmas take noise for white and the search for certain.
TEST(ProcessBands, CoverWhatTheySayOverManyArms) {
  constexpr int kArms = 200;
  const Share calibrated = mean_share(TorqueModelKind::kGip, kArms, 8);
  const Share claimed = mean_share(TorqueModelKind::kGip, kArms, 0);
  // About six independent torques an arm: 200 arms give the share to 1 %.
  EXPECT_NEAR(calibrated.of_90, 0.90, 0.02);
  EXPECT_NEAR(calibrated.of_95, 0.95, 0.02);
  EXPECT_LT(claimed.of_90, 0.85);
  EXPECT_LT(claimed.of_95, 0.90);
}

TEST(ProcessBands, CoverWithLearnedRemainders) {
  constexpr int kArms = 15;
  const Share calibrated = mean_share(TorqueModelKind::kSemiParametric, kArms, 8);
  const Share claimed = mean_share(TorqueModelKind::kSemiParametric, kArms, 0);
  // Few arms: 4 %.
  EXPECT_NEAR(calibrated.of_90, 0.90, 0.06);
  EXPECT_NEAR(calibrated.of_95, 0.95, 0.06);
  EXPECT_LT(claimed.of_90, calibrated.of_90 - 0.05);
}

TorqueSamples arm_log(DynamicModel& model, int trajectories) {
  Rng rng = Rng::from_name("one arm");
  const RandomRobot robot = random_robot({.joints = 1, .prismatic_share = 0.0}, rng);
  model = random_masses(robot.tree, {}, rng);
  return torque_log_of(
      model, {.samples = 200, .rate_hz = 25.0, .noise = 0.1, .trajectories = trajectories}, rng);
}

TorqueModelOptions small_options() {
  TorqueModelOptions options;
  options.samples = 100;
  options.hyperparameter_samples = 60;
  options.starts = 1;
  options.threads = 1;
  return options;
}

// Residuals were judged by what processes of fewer samples doubted; one of all samples is surer.
TEST(ProcessBands, TheSigmaUsedIsTheOneCalibrated) {
  DynamicModel model;
  const TorqueSamples log = arm_log(model, 4);
  TorqueModelOptions options = small_options();
  const FittedTorqueModel fitted = fit_torque_model(TorqueModelKind::kRbf, model, log, options);
  options.band_folds = 0;
  const FittedTorqueModel alone = fit_torque_model(TorqueModelKind::kRbf, model, log, options);
  const Eigen::ArrayXd sure = alone.predict(log.q, log.dq, log.ddq).model_sigma;
  const Eigen::ArrayXd doubt = fitted.claim(log.q, log.dq, log.ddq).model_sigma;
  EXPECT_GT(doubt.mean(), 1.02 * sure.mean());
  EXPECT_EQ(fitted.claim(log.q, log.dq, log.ddq).mean, alone.predict(log.q, log.dq, log.ddq).mean);
}

// Far from all motion the model doubts itself as it never did where its bands were made.
TEST(ProcessBands, SayWhereTheyAreExtrapolated) {
  DynamicModel model;
  const TorqueSamples log = arm_log(model, 1);
  const FittedTorqueModel fitted =
      fit_torque_model(TorqueModelKind::kRbf, model, log, small_options());
  const TorqueScore near = score_torque_model(fitted, log);
  EXPECT_LT(near.extrapolated[0], 0.01);
  EXPECT_EQ(near.band_residuals[0], 200);
  EXPECT_FALSE(near.bands_by_trajectory);
  TorqueSamples far = log;
  far.ddq.array() *= 50.0;
  EXPECT_GT(score_torque_model(fitted, far).extrapolated[0], 0.5);
  DynamicModel other;
  EXPECT_TRUE(
      score_torque_model(
          fit_torque_model(TorqueModelKind::kRbf, model, arm_log(other, 4), small_options()), log)
          .bands_by_trajectory);
}

}  // namespace
}  // namespace kinescope
