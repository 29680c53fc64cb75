// SPDX-License-Identifier: Apache-2.0
//
// A vector over a plane as values at the nodes of a grid, bilinear between them.
#pragma once

#include <Eigen/SparseCore>

#include "calib/trace/traced_model.h"

namespace kinescope::trace {

struct FieldGrid {
  Eigen::MatrixX2d nodes;  ///< those that some row lies beside
  double spacing = 0.0;
  double extent = 0.0;  ///< of the rows' places, the longer side
  /// Rows x (first components of all nodes, then second ones): what the nodes' values do to the
  /// prediction.
  Eigen::SparseMatrix<double, Eigen::RowMajor> columns;

  /// Of one component, squared exponential, variance 1.
  [[nodiscard]] Eigen::MatrixXd correlation(double length) const;
};

/// As fine as `most_nodes` allow. Without nodes where no row has a place, or all have the same.
[[nodiscard]] FieldGrid make_field_grid(const Linearisation& linear, const RestField& field,
                                        int most_nodes);

}  // namespace kinescope::trace
