// SPDX-License-Identifier: Apache-2.0
//
// Large tables of a block of particles, aligned to cache lines and stored in groups of eight
// particles, so that a pass over the columns of a group reads memory in order; internal.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "dynamics/policy/lanes.h"

namespace kinescope::policy {

/// rows x columns, rows a multiple of eight. Element (i, j) stands at ((i / 8) * columns + j) * 8 +
/// i % 8.
class LaneMatrix {
 public:
  LaneMatrix(Eigen::Index rows, Eigen::Index columns)
      : groups_(rows / kLaneCount),
        columns_(columns),
        values_(static_cast<std::size_t>(groups_ * columns)) {}

  [[nodiscard]] Eigen::Index groups() const { return groups_; }
  [[nodiscard]] Eigen::Index columns() const { return columns_; }
  /// Of eight particles: columns one after another.
  [[nodiscard]] double* group(Eigen::Index g) { return at(g); }
  [[nodiscard]] const double* group(Eigen::Index g) const {
    return const_cast<LaneMatrix*>(this)->at(g);
  }
  [[nodiscard]] double operator()(Eigen::Index i, Eigen::Index j) const {
    return group(i / kLaneCount)[j * kLaneCount + i % kLaneCount];
  }

 private:
  struct alignas(sizeof(Lanes)) Group {
    double lane[kLaneCount];
  };
  double* at(Eigen::Index g) { return values_[static_cast<std::size_t>(g * columns_)].lane; }

  Eigen::Index groups_;
  Eigen::Index columns_;
  std::vector<Group> values_;
};

}  // namespace kinescope::policy
