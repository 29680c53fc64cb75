// SPDX-License-Identifier: Apache-2.0
//
// Does the residual contain an effect? Its columns are freed of what the model's own parameters can
// do, fitted to the residual, and judged against the scatter of the stretches' scores.
#pragma once

#include <vector>

#include "calib/trace/normal_system.h"
#include "calib/trace/trace.h"

namespace kinescope::trace {

struct Score {
  Eigen::VectorXd theta;       ///< of the effect's parameters
  Eigen::MatrixXd covariance;  ///< by stretches of time
  /// The same by noise at its usual level and memory, with `freedom`; empty where enough stretches
  /// carry the effect for their scatter to judge it.
  Eigen::MatrixXd pooled;
  double statistic = 0.0;  ///< F
  int rank = 0;            ///< directions of the effect that the data show
  double freedom = 0.0;    ///< of the denominator
  double p_value = 1.0;    ///< of this one test
  double gain = 0.0;       ///< by how much the sum of squares falls
  double rms = 0.0;  ///< of what the effect does to the rows it touches, freed of the model's own
                     ///< parameters, in the residual's unit
  double noise_share = 0.0;  ///< the same over each row's own noise, without a unit
  Eigen::VectorXd of_one;    ///< as much of one unit of each parameter alone, over that of theta
  [[nodiscard]] bool hidden() const { return rank == 0; }
};

/// It moves the rows that it touches by the floors of `options` or more.
[[nodiscard]] bool is_large(const Score& score, const TraceOptions& options);

/// Fall of the sum of squares, without judging it: for scans.
[[nodiscard]] double gain_of(const NormalSystem& system, const std::vector<EffectColumn>& columns);

/// The same for several effects, which costs less than one after the other.
[[nodiscard]] std::vector<double> gains_of(const NormalSystem& system,
                                           const std::vector<std::vector<EffectColumn>>& effects);

/// Score test with a covariance by stretches. Rao 1948; Liang and Zeger 1986; degrees of freedom
/// from the effective number of stretches, Carter, Schnepel and Steigerwald 2017.
[[nodiscard]] Score score_test(const NormalSystem& system,
                               const std::vector<EffectColumn>& columns);

/// The same with a covariance by leaving out one stretch after the other (CR3, Cameron and Miller
/// 2015, section VI): conservative where few stretches carry the effect.
[[nodiscard]] Score jackknife_test(const NormalSystem& system,
                                   const std::vector<EffectColumn>& columns);

/// Covariance of the last `count` parameters of the model itself, by the same jackknife.
[[nodiscard]] Eigen::MatrixXd jackknife_covariance(const NormalSystem& system, Eigen::Index count);

}  // namespace kinescope::trace
