// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/triangle_product.h"

#include <algorithm>
#include <array>

#include "dynamics/gp/simd.h"
#include "dynamics/policy/lanes.h"
#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

constexpr Index kPanel = 8;

struct Tile {
  const double* in;  // of the first group of particles
  Index group_stride;
  const double* packed;
  Index rows;  // of the panel, the inner dimension
  double* out;
  Index columns;  // of the panel that exist
};

// kGroups of lanes of particles times kColumns columns of the panel from column `first`, sums in
// registers.
template <std::size_t kGroups, std::size_t kColumns>
[[gnu::always_inline]] inline void tile(const Tile& t, Index first) {
  Lanes acc[kGroups][kColumns] = {};
  const double* in[kGroups];
  for (std::size_t g = 0; g < kGroups; ++g) in[g] = t.in + static_cast<Index>(g) * t.group_stride;
  const double* factor = t.packed + first;
  for (Index k = 0; k < t.rows; ++k) {
    Lanes row[kGroups];
#pragma GCC unroll 4
    for (std::size_t g = 0; g < kGroups; ++g) load(in[g] + k * kLaneCount, row[g]);
#pragma GCC unroll 8
    for (std::size_t c = 0; c < kColumns; ++c) {
#pragma GCC unroll 4
      for (std::size_t g = 0; g < kGroups; ++g) acc[g][c] += row[g] * factor[c];
    }
    factor += kPanel;
  }
#pragma GCC unroll 8
  for (std::size_t c = 0; c < kColumns; ++c) {
    const Index column = first + static_cast<Index>(c);
    if (column >= t.columns) break;
    double* out = t.out + column * kLaneCount;
#pragma GCC unroll 4
    for (std::size_t g = 0; g < kGroups; ++g) {
      store(acc[g][c], out + static_cast<Index>(g) * t.group_stride);
    }
  }
}

// 24 sums in registers where there are 32 of 512 bits, else 4 times 2 of 256 bits.
KINESCOPE_WIDE void wide_tile(const Tile& t, Index groups) {
  if (groups == 3) tile<3, kPanel>(t, 0);
  if (groups == 2) tile<2, kPanel>(t, 0);
  if (groups == 1) tile<1, kPanel>(t, 0);
}
KINESCOPE_WIDE void narrow_tile(const Tile& t) {
  tile<1, kPanel / 2>(t, 0);
  tile<1, kPanel / 2>(t, kPanel / 2);
}

bool has_wide_registers() {
#if defined(__x86_64__)
  static const bool wide = __builtin_cpu_supports("avx512f") != 0;
  return wide;
#else
  return false;
#endif
}

}  // namespace

TriangleProduct::TriangleProduct(const Eigen::MatrixXd& inverse_factor)
    : size_(inverse_factor.rows()) {
  KINESCOPE_CHECK(inverse_factor.cols() == size_, "a square factor");
  for (Index begin = 0; begin < size_; begin += kPanel) {
    const Index end = std::min(size_, begin + kPanel);
    transposed_.panels.push_back({0, end, transposed_.values.size()});
    for (Index k = 0; k < end; ++k) {
      for (Index c = begin; c < begin + kPanel; ++c) {
        transposed_.values.push_back(c < size_ && k <= c ? inverse_factor(c, k) : 0.0);
      }
    }
    plain_.panels.push_back({begin, size_ - begin, plain_.values.size()});
    for (Index j = begin; j < size_; ++j) {
      for (Index c = begin; c < begin + kPanel; ++c) {
        plain_.values.push_back(c <= j ? inverse_factor(j, c) : 0.0);
      }
    }
  }
}

void TriangleProduct::multiply(const Packed& packed, const LaneMatrix& in, LaneMatrix& out) {
  const Index size = in.columns();
  const Index groups_a_tile = has_wide_registers() ? 3 : 1;
  for (Index first = 0; first < in.groups(); first += groups_a_tile) {
    const Index groups = std::min(groups_a_tile, in.groups() - first);
    for (std::size_t p = 0; p < packed.panels.size(); ++p) {
      const Panel& panel = packed.panels[p];
      const Index column = static_cast<Index>(p) * kPanel;
      const Tile t{in.group(first) + panel.first_row * kLaneCount,
                   size * kLaneCount,
                   packed.values.data() + panel.at,
                   panel.rows,
                   out.group(first) + column * kLaneCount,
                   std::min(kPanel, size - column)};
      if (groups_a_tile == 1) {
        narrow_tile(t);
      } else {
        wide_tile(t, groups);
      }
    }
  }
}

void TriangleProduct::times_transposed(const LaneMatrix& k, LaneMatrix& out) const {
  multiply(transposed_, k, out);
}

void TriangleProduct::times(const LaneMatrix& v, LaneMatrix& out) const {
  multiply(plain_, v, out);
}

}  // namespace kinescope::policy
