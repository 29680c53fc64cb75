// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/field_grid.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace kinescope::trace {
namespace {

constexpr double kFinest = 64.0;  // nodes along the longer side
constexpr double kCoarser = 1.2;  // from one attempt to the next
constexpr int kFewest = 16;

// The four nodes around a place, and how much of the value there is each one's.
struct Corner {
  std::array<int, 2> node{};
  double weight = 0.0;
};
using Corners = std::array<Corner, 4>;

Corners corners_of(const Eigen::Vector2d& place, const Eigen::Vector2d& origin, double spacing) {
  const Eigen::Vector2d at = (place - origin) / spacing;
  const Eigen::Vector2d low = at.array().floor();
  Corners out;
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector2i step(k % 2, k / 2);
    Corner& corner = out[static_cast<std::size_t>(k)];
    corner.weight = 1.0;
    for (int axis = 0; axis < 2; ++axis) {
      corner.node[static_cast<std::size_t>(axis)] = static_cast<int>(low[axis]) + step[axis];
      const double above = at[axis] - low[axis];
      corner.weight *= step[axis] == 0 ? 1.0 - above : above;
    }
  }
  return out;
}

// Number of each node of the grid in the order of its places, -1 where no row lies beside it.
struct NodeNumbers {
  Eigen::MatrixXi number;
  int count = 0;
};

NodeNumbers number_nodes(const Eigen::MatrixX2d& places, const Eigen::Vector2d& low,
                         const Eigen::Vector2d& high, double spacing) {
  const Eigen::Vector2i size = ((high - low) / spacing).array().floor().cast<int>() + 2;
  NodeNumbers out{Eigen::MatrixXi::Constant(size.x(), size.y(), -1), 0};
  for (Eigen::Index row = 0; row < places.rows(); ++row) {
    if (!places.row(row).allFinite()) continue;
    for (const Corner& corner : corners_of(places.row(row).transpose(), low, spacing)) {
      if (corner.weight > 0.0) out.number(corner.node[0], corner.node[1]) = 0;
    }
  }
  for (int& number : out.number.reshaped()) {
    if (number == 0) number = out.count++;
  }
  return out;
}

}  // namespace

Eigen::MatrixXd FieldGrid::correlation(double length) const {
  const Eigen::Index n = nodes.rows();
  Eigen::MatrixXd K(n, n);
  for (Eigen::Index a = 0; a < n; ++a) {
    for (Eigen::Index b = 0; b < n; ++b) {
      K(a, b) = std::exp(-0.5 * (nodes.row(a) - nodes.row(b)).squaredNorm() / (length * length));
    }
  }
  K.diagonal().array() += 1e-8;
  return K;
}

FieldGrid make_field_grid(const Linearisation& linear, const RestField& field, int most_nodes) {
  FieldGrid out;
  constexpr double kFar = 1e300;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(kFar);
  Eigen::Vector2d high = -low;
  for (Eigen::Index row = 0; row < field.at.rows(); ++row) {
    if (!field.at.row(row).allFinite()) continue;
    low = low.cwiseMin(field.at.row(row).transpose());
    high = high.cwiseMax(field.at.row(row).transpose());
  }
  out.extent = (high - low).maxCoeff();
  if (!(out.extent > 0.0)) return out;
  out.spacing = out.extent / kFinest;
  NodeNumbers numbers = number_nodes(field.at, low, high, out.spacing);
  while (numbers.count > std::max(most_nodes, kFewest)) {
    out.spacing *= kCoarser;
    numbers = number_nodes(field.at, low, high, out.spacing);
  }
  const Eigen::Index n = numbers.count;
  out.nodes.resize(n, 2);
  for (Eigen::Index y = 0; y < numbers.number.cols(); ++y) {
    for (Eigen::Index x = 0; x < numbers.number.rows(); ++x) {
      const int number = numbers.number(x, y);
      if (number < 0) continue;
      out.nodes.row(number) =
          low.transpose() +
          out.spacing * Eigen::RowVector2d(static_cast<double>(x), static_cast<double>(y));
    }
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (int component = 0; component < 2; ++component) {
    using Entries = Eigen::SparseMatrix<double>::InnerIterator;
    for (Entries entry(linear.carriers, field.carriers[static_cast<std::size_t>(component)]); entry;
         ++entry) {
      const auto place = field.at.row(entry.row());
      if (!place.allFinite()) continue;
      for (const Corner& corner : corners_of(place.transpose(), low, out.spacing)) {
        if (!(corner.weight > 0.0)) continue;
        entries.emplace_back(
            static_cast<int>(entry.row()),
            static_cast<int>(component * n + numbers.number(corner.node[0], corner.node[1])),
            entry.value() * corner.weight);
      }
    }
  }
  out.columns.resize(linear.residual.size(), 2 * n);
  out.columns.setFromTriplets(entries.begin(), entries.end());
  return out;
}

}  // namespace kinescope::trace
