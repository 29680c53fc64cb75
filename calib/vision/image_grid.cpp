// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/image_grid.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace kinescope {

GridCounts empty_grid() {
  return GridCounts(static_cast<std::size_t>(kGridColumns * kGridRows), 0);
}

void count_point(GridCounts& counts, const Eigen::Vector2d& point_px, int width, int height) {
  const int c = std::clamp(static_cast<int>((point_px.x() + 0.5) / width * kGridColumns), 0,
                           kGridColumns - 1);
  const int r =
      std::clamp(static_cast<int>((point_px.y() + 0.5) / height * kGridRows), 0, kGridRows - 1);
  ++counts[static_cast<std::size_t>(r * kGridColumns + c)];
}

double covered_share(const GridCounts& counts) {
  const auto seen = std::ranges::count_if(counts, [](int n) { return n > 0; });
  return static_cast<double>(seen) / (kGridColumns * kGridRows);
}

std::string_view emptiest_side(const GridCounts& counts) {
  std::array<int, 4> cells{};  // seen cells in the left, right, upper, lower third
  for (int r = 0; r < kGridRows; ++r) {
    for (int c = 0; c < kGridColumns; ++c) {
      if (counts[static_cast<std::size_t>(r * kGridColumns + c)] == 0) continue;
      if (c < 3) ++cells[0];
      if (c >= kGridColumns - 3) ++cells[1];
      if (r < 3) ++cells[2];
      if (r >= kGridRows - 3) ++cells[3];
    }
  }
  constexpr std::array<std::string_view, 4> kNames = {"left", "right", "upper", "lower"};
  constexpr std::array<int, 4> kWhole = {3 * kGridRows, 3 * kGridRows, 3 * kGridColumns,
                                         3 * kGridColumns};
  std::size_t worst = 0;
  for (std::size_t i = 1; i < 4; ++i) {
    if (cells[i] * kWhole[worst] < cells[worst] * kWhole[i]) worst = i;
  }
  return kNames[worst];
}

}  // namespace kinescope
