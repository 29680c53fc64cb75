// SPDX-License-Identifier: Apache-2.0
//
// Which parts of the image something was seen in, on a coarse grid.
#pragma once

#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace kinescope {

inline constexpr int kGridColumns = 10;
inline constexpr int kGridRows = 8;

/// What a lens is known well with.
inline constexpr double kGoodCoverage = 0.6;  ///< share of the grid's cells
inline constexpr double kGoodTilt_deg = 35.0;

/// Of how many points are in each cell, row by row.
using GridCounts = std::vector<int>;
[[nodiscard]] GridCounts empty_grid();
/// Counts a point of an image of that size; px, centre of pixel at 0.
void count_point(GridCounts& counts, const Eigen::Vector2d& point_px, int width, int height);
/// Share of the cells with a point.
[[nodiscard]] double covered_share(const GridCounts& counts);
/// "left", "right", "upper" or "lower": the third of the image with the fewest cells covered.
[[nodiscard]] std::string_view emptiest_side(const GridCounts& counts);

}  // namespace kinescope
