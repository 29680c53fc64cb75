// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynamics/gp/feature_map.h"

namespace kinescope::gp {

struct Dataset {
  Eigen::MatrixXd inputs;      ///< samples x columns
  Eigen::MatrixXd targets;     ///< samples x outputs
  Eigen::MatrixXd prior_mean;  ///< samples x outputs, what is known of the targets; empty: nothing
  /// samples x outputs: noise variance of each target, relative to the model's; empty: all 1.
  Eigen::MatrixXd noise_scale;

  [[nodiscard]] Eigen::Index samples() const { return inputs.rows(); }
};

/// The samples with these indices, in this order.
[[nodiscard]] Dataset subset(const Dataset& dataset, const std::vector<Eigen::Index>& indices);

/// x -> (x - shift) / scale, column by column. Empty: as it is.
struct Normalisation {
  Eigen::RowVectorXd input_shift;
  Eigen::RowVectorXd input_scale;
  Eigen::RowVectorXd target_shift;
  Eigen::RowVectorXd target_scale;

  [[nodiscard]] Eigen::MatrixXd normalised_inputs(const Inputs& inputs) const;
};

/// Mean 0 and standard deviation 1 of every input column and of every target less its prior mean;
/// columns that do not vary are only shifted.
[[nodiscard]] Normalisation standardise(const Dataset& dataset);
/// Targets alone: for kernels that need inputs in rad and m.
[[nodiscard]] Normalisation standardise_targets(const Dataset& dataset);

}  // namespace kinescope::gp
