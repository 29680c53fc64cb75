// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/feature_map.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope::gp {

Eigen::MatrixXd FeatureMap::operator()(const Inputs& inputs) const {
  Eigen::MatrixXd features(inputs.rows(), size());
  map(inputs, features);
  return features;
}

FeatureMap columns(std::vector<int> indices) {
  FeatureMap out;
  for (const int index : indices) {
    KINESCOPE_CHECK(index >= 0, "a negative column");
    out.names.push_back(fmt::format("x{}", index));
    out.input_columns = std::max(out.input_columns, index + 1);
  }
  out.map = [indices = std::move(indices)](const Inputs& inputs, Features features) {
    for (std::size_t k = 0; k < indices.size(); ++k) {
      features.col(static_cast<Eigen::Index>(k)) = inputs.col(indices[k]);
    }
  };
  return out;
}

FeatureMap first_columns(int count) {
  std::vector<int> indices;
  indices.reserve(static_cast<std::size_t>(std::max(0, count)));
  for (int i = 0; i < count; ++i) indices.push_back(i);
  return columns(std::move(indices));
}

FeatureMap angle(int column) {
  KINESCOPE_CHECK(column >= 0, "a negative column");
  return {{fmt::format("cos x{}", column), fmt::format("sin x{}", column)},
          column + 1,
          [column](const Inputs& inputs, Features features) {
            features.col(0) = inputs.col(column).array().cos();
            features.col(1) = inputs.col(column).array().sin();
          }};
}

FeatureMap joined(FeatureMap a, FeatureMap b) {
  FeatureMap out{a.names, std::max(a.input_columns, b.input_columns), {}};
  out.names.insert(out.names.end(), b.names.begin(), b.names.end());
  out.map = [a = std::move(a), b = std::move(b)](const Inputs& inputs, Features features) {
    a.map(inputs, features.leftCols(a.size()));
    b.map(inputs, features.rightCols(b.size()));
  };
  return out;
}

FeatureMap mixed(FeatureMap map, Eigen::MatrixXd mixing) {
  KINESCOPE_CHECK(mixing.rows() == map.size(), "one row of `mixing` for each feature");
  FeatureMap out{{}, map.input_columns, {}};
  for (Eigen::Index k = 0; k < mixing.cols(); ++k) out.names.push_back(fmt::format("mix {}", k));
  out.map = [map = std::move(map), mixing = std::move(mixing)](const Inputs& inputs,
                                                               Features features) {
    features.noalias() = map(inputs) * mixing;
  };
  return out;
}

FeatureMap friction(int velocity_column, double transition_velocity) {
  KINESCOPE_CHECK(velocity_column >= 0 && transition_velocity >= 0.0, "a negative argument");
  return {
      {fmt::format("viscous x{}", velocity_column), fmt::format("Coulomb x{}", velocity_column)},
      velocity_column + 1,
      [velocity_column, transition_velocity](const Inputs& inputs, Features features) {
        const auto velocity = inputs.col(velocity_column).array();
        features.col(0) = velocity;
        if (transition_velocity > 0.0) {
          features.col(1) = (velocity / transition_velocity).tanh();
        } else {
          features.col(1) = velocity.sign();
        }
      }};
}

}  // namespace kinescope::gp
