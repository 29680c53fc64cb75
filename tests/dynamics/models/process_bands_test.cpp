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

}  // namespace
}  // namespace kinescope
