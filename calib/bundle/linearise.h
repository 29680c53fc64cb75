// SPDX-License-Identifier: Apache-2.0
//
// The bundle's residuals and their derivatives, frame by frame, at a state.
#pragma once

#include <array>
#include <map>
#include <vector>

#include <Eigen/SparseCore>

#include "calib/bundle/problem.h"

namespace kinescope::bundle {

/// The rows of one frame, its sightings in their order; what only this frame knows (joint values
/// without a channel) is eliminated. Of thousands of parameters a frame shows some.
struct FrameRows {
  std::vector<Eigen::Index> shown;  ///< parameters, ascending
  Eigen::MatrixXd J;                ///< rows x shown: d residual / d parameter
  Eigen::VectorXd r;                ///< whitened

  /// J of all parameters.
  [[nodiscard]] Eigen::MatrixXd dense(int width) const;
};

struct LinearBundle {
  std::vector<FreeBlock> blocks;    ///< of the columns
  std::map<int, FrameRows> frames;  ///< by frame; distances between targets under -1
  Eigen::SparseMatrix<double> prior_information;
  Eigen::VectorXd prior_gradient;  ///< of half the priors' squares
};

[[nodiscard]] int width_of(const std::vector<FreeBlock>& blocks);

/// Where each component of a pose block stands among the parameters; -1: held.
using PoseColumns = std::array<int, 6>;
[[nodiscard]] std::map<const double*, PoseColumns> pose_columns(
    const std::vector<FreeBlock>& blocks);

[[nodiscard]] LinearBundle linearise(const Spec& spec, State& state, const std::vector<int>& used);

/// Pooled autocorrelation of the whitened residuals of each marker's coordinates, integrated, s.
[[nodiscard]] double correlation_time(const Spec& spec, const State& state,
                                      const std::vector<int>& used);

}  // namespace kinescope::bundle
