// SPDX-License-Identifier: Apache-2.0
//
// Torque models side by side on trajectories that none of them has seen.
#pragma once

#include "dynamics/models/torque_model.h"

namespace kinescope {

/// How a model did; one entry a joint.
struct TorqueScore {
  TorqueModelKind kind = TorqueModelKind::kParametric;
  bool traced = false;  ///< not of a kind: rigid bodies with the effects that tracing found
  int training_samples = 0;
  int test_samples = 0;
  Eigen::VectorXd nmse_percent;  ///< mean squared error over the variance of the measured torque
  Eigen::VectorXd rms;           ///< of the error, in the torque's unit
  Eigen::VectorXd coverage_90;   ///< share of the test samples within the 90 % band, 0 to 1
  Eigen::VectorXd coverage_95;
  /// Share of the test samples where the model doubts itself more than at any sample that its bands
  /// were calibrated on, 0 to 1: there they are extrapolated. NaN: not known.
  Eigen::VectorXd extrapolated;
  /// Residuals that the bands come from; 0: the normal distribution's.
  Eigen::VectorXi band_residuals;
  /// Those residuals are of whole trajectories; else of blocks with motion learned from around
  /// them, which says less about what comes later.
  bool bands_by_trajectory = false;
  std::vector<int> plainer_joints = {};   ///< FittedTorqueModel's
  std::vector<int> constant_joints = {};  ///< FittedTorqueModel's
  int inducing_points = 0;                ///< FittedTorqueModel's
  /// On motion left out of the training: what models are chosen by. Empty: not known.
  Eigen::VectorXd left_out_nmse_percent = {};
  std::string failure;  ///< why there is no score; empty where there is one
};

/// to_string(kind), or "traced".
[[nodiscard]] std::string_view name_of(const TorqueScore& score);

[[nodiscard]] TorqueScore score_torque_model(const FittedTorqueModel& fitted,
                                             const TorqueSamples& test);

/// The part of a score that a prediction of the test and its bands give.
[[nodiscard]] TorqueScore score_prediction(const TorquePrediction& prediction,
                                           const BandFactors& bands, const TorqueSamples& test);

/// Joints of the test that the model predicts worse than a constant would (nMSE above 100 %); those
/// at which it is one do not count.
[[nodiscard]] std::vector<int> worse_than_constant(const TorqueScore& score);

/// The score to rely on: the least mean error on motion left out of the training; those that do
/// worse than a constant at a joint there come last. The test has no part in it. The first, where
/// nothing was left out; 0 where no model was fitted.
[[nodiscard]] int best_score(const std::vector<TorqueScore>& scores);

/// One score a kind, in the order of `kinds`. A model that cannot be fitted gets its reason.
[[nodiscard]] std::vector<TorqueScore> compare_torque_models(
    const std::vector<TorqueModelKind>& kinds, const DynamicModel& model,
    const TorqueSamples& train, const TorqueSamples& test, const TorqueModelOptions& options = {});

struct LearningPoint {
  int samples = 0;
  double nmse_percent = 0.0;  ///< over all joints: sum of squared errors over sum of variances
};

/// The score of a kind against the number of samples learned from, evenly chosen.
[[nodiscard]] std::vector<LearningPoint> learning_curve(TorqueModelKind kind,
                                                        const DynamicModel& model,
                                                        const TorqueSamples& train,
                                                        const TorqueSamples& test,
                                                        const std::vector<int>& sizes,
                                                        const TorqueModelOptions& options = {});

}  // namespace kinescope
