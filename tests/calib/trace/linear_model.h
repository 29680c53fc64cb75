// SPDX-License-Identifier: Apache-2.0
//
// A small linearised model of random numbers, and an effect that it lacks.
#pragma once

#include <vector>

#include "calib/trace/traced_model.h"
#include "kinematics/core/rng.h"

namespace kinescope::trace {

inline constexpr Eigen::Index kInstants = 240;
inline constexpr Eigen::Index kRowsPerInstant = 3;
inline constexpr Eigen::Index kParameters = 4;

// A model at a point that is not quite its solution (as after a fit that stopped early), with a
// prior, noise that remembers, and three carriers of which each row knows two.
inline Linearisation linear_model(double memory = 0.5) {
  Linearisation out;
  Rng rng = Rng::from_name("score test");
  const Eigen::Index rows = kInstants * kRowsPerInstant;
  out.residual.resize(rows);
  out.jacobian.resize(rows, kParameters);
  double noise = 0.0;
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index row = 0; row < rows; ++row) {
    for (Eigen::Index c = 0; c < kParameters; ++c) out.jacobian(row, c) = rng.normal();
    noise = memory * noise + rng.normal();
    out.residual[row] = noise;
    for (const Eigen::Index c : {row % 3, (row + 1) % 3})
      entries.emplace_back(static_cast<int>(row), static_cast<int>(c), rng.normal());
  }
  out.carriers.resize(rows, 3);
  out.carriers.setFromTriplets(entries.begin(), entries.end());
  out.prior = 5.0 * Eigen::MatrixXd::Identity(kParameters, kParameters);
  out.time_s = Eigen::VectorXd::LinSpaced(kInstants, 0.0, 0.1 * (kInstants - 1));
  for (Eigen::Index i = 0; i <= kInstants; ++i) out.first_row.push_back(i * kRowsPerInstant);
  for (Eigen::Index i = 0; i < kInstants; ++i) out.fold.push_back(static_cast<int>(i / 11 % 5));
  out.unit = Eigen::VectorXd::Constant(rows, 0.1);
  out.unit_name = "px";
  out.correlation_time_s = 0.1;
  return out;
}

inline std::vector<EffectColumn> effect() {
  const Eigen::ArrayXd t = Eigen::ArrayXd::LinSpaced(kInstants, 0.0, 9.0);
  return {{0, t.sin()}, {2, (0.7 * t).cos() + 0.3}};
}

// The effect's columns, row by row.
inline Eigen::MatrixXd explicit_columns(const Linearisation& linear,
                                        const std::vector<EffectColumn>& columns) {
  Eigen::MatrixXd out(linear.residual.size(), static_cast<Eigen::Index>(columns.size()));
  const Eigen::MatrixXd carriers(linear.carriers);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    for (Eigen::Index row = 0; row < out.rows(); ++row) {
      const double share =
          columns[k].share.size() == 0 ? 1.0 : columns[k].share[row / kRowsPerInstant];
      out(row, static_cast<Eigen::Index>(k)) = share * carriers(row, columns[k].carrier);
    }
  }
  return out;
}

inline double relative(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).norm() / b.norm();
}

}  // namespace kinescope::trace
