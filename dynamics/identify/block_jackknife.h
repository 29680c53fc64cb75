// SPDX-License-Identifier: Apache-2.0
//
// How much the parameters would scatter, without a model of the noise: leave out one stretch of the
// log after the other and look what happens. Stretches are longer than the noise's memory, so noise
// that is coloured in time or common to joints, and what the model lacks, count for what they do.
// Künsch 1989; for regressions this is the CR3 estimator, Cameron and Miller 2015, section VI.
#pragma once

#include <vector>

#include "dynamics/identify/weighted_fit.h"

namespace kinescope::identify {

/// Rows [first, first + rows), within one trajectory.
struct Block {
  Eigen::Index first = 0;
  Eigen::Index rows = 0;
};

/// Integral time of the residuals' autocorrelation in samples, 1 for white ones: the largest of the
/// joints, summed to the first lag that is not positive. Rows of weight 0 count as 0.
[[nodiscard]] double correlation_samples(const Eigen::MatrixXd& residuals,
                                         const Eigen::VectorXi& trajectory);

/// Stretches of nearly equal length, at least `fewest` of them, about `rows` long.
[[nodiscard]] std::vector<Block> make_blocks(const Eigen::VectorXi& trajectory, double rows,
                                             int fewest);

/// Covariance of weighted_fit()'s parameters. Without a robust loss the fits without a block are
/// exact; with one they are one Newton step.
[[nodiscard]] Eigen::MatrixXd jackknife_covariance(const StackedSystem& system,
                                                   const WeightedFit& fit, double ridge,
                                                   const std::vector<Block>& blocks);

}  // namespace kinescope::identify
