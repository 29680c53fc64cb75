// SPDX-License-Identifier: Apache-2.0
//
// Torque models side by side on trajectories that none of them has seen.
#pragma once

#include "dynamics/models/torque_model.h"

namespace kinescope {

/// How a model did; one entry a joint.
struct TorqueScore {
  TorqueModelKind kind = TorqueModelKind::kParametric;
  int training_samples = 0;
  int test_samples = 0;
  Eigen::VectorXd nmse_percent;  ///< mean squared error over the variance of the measured torque
  Eigen::VectorXd rms;           ///< of the error, in the torque's unit
  Eigen::VectorXd coverage_90;   ///< share of the test samples within the 90 % band, 0 to 1
  Eigen::VectorXd coverage_95;
  std::string failure;  ///< why there is no score; empty where there is one
};

[[nodiscard]] TorqueScore score_torque_model(const FittedTorqueModel& fitted,
                                             const TorqueSamples& test);

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
