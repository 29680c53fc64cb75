// SPDX-License-Identifier: Apache-2.0
//
// Kernel rows of a block of particles against the samples of a process, with the mean, and their
// pullback: one pass over samples and particles each, internal. Rows are particles, a multiple of
// eight.
#pragma once

#include <array>

#include "dynamics/policy/lane_matrix.h"
#include "dynamics/policy/rbf_passes.h"
#include "dynamics/policy/velocity_model.h"

namespace kinescope::policy {

/// The samples as the passes read them.
struct PreparedSamples {
  PreparedSamples() = default;
  /// `linear`: samples x G, what the factors are linear in.
  PreparedSamples(const KernelValues& kernel, const Eigen::MatrixXd& inputs,
                  const Eigen::MatrixXd& linear, const Eigen::VectorXd& weights);
  double variance = 1.0;
  Eigen::RowVectorXd inverse_scales;  ///< D
  RowMajor scaled;                    ///< N x D, over the length scales
  Eigen::VectorXd half_squares;       ///< N: -1/2 |scaled|^2
  Eigen::VectorXd weights;            ///< N, of the mean
  Eigen::Index factors = 0;           ///< 0, 1 or 2
  std::array<RowMajor, 2> slopes;     ///< N x G each: weights times what the factor is linear in
  std::array<double, 2> offsets{1.0, 1.0};
};

/// `scaled`: particles x D, inputs over the length scales; `linear`: particles x G. `smooth`:
/// particles x N, the exponential part alone; `kernel`: all of it; mean: particles.
void kernel_value(const PreparedSamples& samples, const ConstBlock& scaled,
                  const ConstBlock& linear, LaneMatrix& smooth, LaneMatrix& kernel, Block mean);

/// d k(i, j) = d_mean_i weights_j - 2 d_variance_i solved(i, j), with solved = K* A^-1. d_scaled
/// (particles x D) and d_linear (particles x G) are overwritten.
void kernel_pullback(const PreparedSamples& samples, const ConstBlock& scaled,
                     const ConstBlock& linear, const LaneMatrix& smooth, const LaneMatrix& solved,
                     const ConstBlock& d_mean, const ConstBlock& d_variance, Block d_scaled,
                     Block d_linear);

/// Row sums of squares: particles.
void squared_rows(const LaneMatrix& values, Block sums);

}  // namespace kinescope::policy
