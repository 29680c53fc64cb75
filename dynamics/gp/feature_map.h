// SPDX-License-Identifier: Apache-2.0
//
// From inputs (samples x columns) to features (samples x features). A value; maps of columns,
// angles and friction are made here, others by the caller.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace kinescope::gp {

using Inputs = Eigen::Ref<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
using Features = Eigen::Ref<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

struct FeatureMap {
  std::vector<std::string> names;  ///< one for each feature
  int input_columns = 0;           ///< the inputs must have at least so many
  /// Writes samples x features. Must treat every sample (row) alike and alone.
  std::function<void(const Inputs& inputs, Features features)> map;

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(names.size()); }
  [[nodiscard]] Eigen::MatrixXd operator()(const Inputs& inputs) const;
};

/// The columns as they are. Names: "x0", "x1", ..
[[nodiscard]] FeatureMap columns(std::vector<int> indices);
/// Columns 0 .. count-1.
[[nodiscard]] FeatureMap first_columns(int count);
/// (cos, sin) of a column in rad.
[[nodiscard]] FeatureMap angle(int column);
/// All features of `a`, then all of `b`.
[[nodiscard]] FeatureMap joined(FeatureMap a, FeatureMap b);
/// features * mixing: samples x mixing.cols().
[[nodiscard]] FeatureMap mixed(FeatureMap map, Eigen::MatrixXd mixing);
/// Viscous and Coulomb friction of a velocity column: (dq, sign dq); with a transition velocity
/// the sign becomes tanh(dq / transition).
[[nodiscard]] FeatureMap friction(int velocity_column, double transition_velocity = 0.0);

}  // namespace kinescope::gp
