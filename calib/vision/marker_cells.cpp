// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/marker_cells.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Geometry>

#include "calib/vision/marker_edges.h"

namespace kinescope {
namespace {

constexpr double kMostUnclear = 0.25;  // of the cells

}  // namespace

double light_at(const ImageView& image, const Eigen::Vector2d& px, const ToneCurve& tone) {
  const double x = std::clamp(px.x(), 0.0, image.width - 1.001);
  const double y = std::clamp(px.y(), 0.0, image.height - 1.001);
  const int left = static_cast<int>(x);
  const int top = static_cast<int>(y);
  const std::uint8_t* row = image.data + static_cast<std::ptrdiff_t>(image.stride) * top + left;
  const std::uint8_t* next = row + image.stride;
  const double a = x - left;
  const auto between = [&](const auto& light) {
    return (1.0 - (y - top)) * ((1.0 - a) * light(row[0]) + a * light(row[1])) +
           (y - top) * ((1.0 - a) * light(next[0]) + a * light(next[1]));
  };
  if (tone.is_linear()) return between([](std::uint8_t pixel) -> double { return pixel; });
  return between([&](std::uint8_t pixel) { return tone.light(pixel); });
}

bool MarkerCells::is_readable() const { return contrast > corner_fit::kMinContrast; }

MarkerCells read_cells(const ImageView& image, const Eigen::Matrix3d& H, int cells,
                       const ToneCurve& tone, double middle_of_cell) {
  const double width = 2.0 / cells;
  const auto middle = [&](int i) { return -1.0 + (i + 0.5) * width; };
  MarkerCells out{Eigen::MatrixXd(cells, cells), 0.0};
  for (int i = 0; i < cells; ++i) {
    for (int j = 0; j < cells; ++j) {
      double sum = 0.0;
      for (const double dx : {-middle_of_cell, 0.0, middle_of_cell}) {
        for (const double dy : {-middle_of_cell, 0.0, middle_of_cell}) {
          const Eigen::Vector2d at(middle(i) + dx * width, middle(j) + dy * width);
          sum += light_at(image, (H * at.homogeneous()).hnormalized(), tone);
        }
      }
      out.level(i, j) = sum / 9.0;
    }
  }
  out.contrast = out.level.maxCoeff() - out.level.minCoeff();
  return out;
}

bool is_same_code(const MarkerCells& a, const MarkerCells& b) {
  if (!a.is_readable() || !b.is_readable() || a.level.size() != b.level.size()) return false;
  // -0.5 (darkest) to 0.5 (brightest)
  const auto place = [](const MarkerCells& cells, Eigen::Index k) {
    return (cells.level(k) - cells.level.minCoeff()) / cells.contrast - 0.5;
  };
  Eigen::Index unclear = 0;
  for (Eigen::Index k = 0; k < a.level.size(); ++k) {
    const double in_a = place(a, k);
    const double in_b = place(b, k);
    if (std::min(std::abs(in_a), std::abs(in_b)) < kClearCell) {
      ++unclear;
    } else if ((in_a < 0.0) != (in_b < 0.0)) {
      return false;
    }
  }
  return static_cast<double>(unclear) <= kMostUnclear * static_cast<double>(a.level.size());
}

}  // namespace kinescope
