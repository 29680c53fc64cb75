// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/marker_edges.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace kinescope::corner_fit {
namespace {

constexpr double kReach = 2.0;         // blurs at which a neighbouring step has faded to 2 %
constexpr double kCornerReach = 2.5;   // the same at corners, where two edges meet
constexpr double kMinHalfWidth = 1.1;  // px, of the strip beside an edge
constexpr double kMaxHalfWidth = 3.0;  // px, at blurs below 1 px; beyond, in blurs

Eigen::Vector2d mapped(const Eigen::Matrix3d& H, double x, double y) {
  return (H * Eigen::Vector3d(x, y, 1.0)).hnormalized();
}

double strip_width(double cell_px, double blur_px) {
  const double wanted = std::max(kMaxHalfWidth, kMaxHalfWidth * blur_px);
  return std::max(kMinHalfWidth, std::min(wanted, cell_px - kReach * blur_px));
}

double faded(double width, double distance) {
  const double t = std::clamp((width - distance) / kTaper, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// Calls `visit` for 0 .. `last` in order, but only where a row of pixels is in some edge's strip;
// `first`: distance outward of every edge at 0.
template <typename Visit>
void for_each_in_strips(const std::array<Edge, 4>& edges, const std::array<double, 4>& first,
                        int last, const Visit& visit) {
  if (last < 0) return;  // beside the image
  std::array<std::pair<int, int>, 4> spans;
  for (std::size_t e = 0; e < 4; ++e) {
    constexpr double kLevel = 1e-9;  // px a px
    const double slope = edges[e].outward.x();
    spans[e] = {0, last};
    if (std::abs(slope) < kLevel) continue;
    const double a = (-edges[e].inner_width - first[e]) / slope;
    const double b = (edges[e].outer_width - first[e]) / slope;
    const auto inside = [&](double offset) { return std::clamp(offset, -1.0, last + 1.0); };
    spans[e] = {std::max(0, static_cast<int>(std::floor(inside(std::min(a, b))))),
                std::min(last, static_cast<int>(std::ceil(inside(std::max(a, b)))))};
  }
  std::ranges::sort(spans);
  int next = 0;
  for (const auto& [from, to] : spans) {
    for (next = std::max(next, from); next <= to; ++next) visit(next);
  }
}

}  // namespace

std::optional<Eigen::Matrix3d> tag_to_image(const Corners& corners) {
  Eigen::Matrix<double, 8, 8> A;
  Eigen::Matrix<double, 8, 1> b;
  for (int i = 0; i < 4; ++i) {
    const double x = kSquare[static_cast<std::size_t>(i)].x();
    const double y = kSquare[static_cast<std::size_t>(i)].y();
    const Eigen::Vector2d& p = corners[static_cast<std::size_t>(i)];
    A.row(2 * i) << x, y, 1.0, 0.0, 0.0, 0.0, -x * p.x(), -y * p.x();
    A.row(2 * i + 1) << 0.0, 0.0, 0.0, x, y, 1.0, -x * p.y(), -y * p.y();
    b(2 * i) = p.x();
    b(2 * i + 1) = p.y();
  }
  const Eigen::FullPivLU<Eigen::Matrix<double, 8, 8>> lu(A);
  if (!lu.isInvertible()) return std::nullopt;
  const Eigen::Matrix<double, 8, 1> h = lu.solve(b);
  Eigen::Matrix3d H;
  H << h(0), h(1), h(2), h(3), h(4), h(5), h(6), h(7), 1.0;
  return H;
}

std::optional<std::array<Edge, 4>> make_edges(const Corners& corners, const TagLayout& layout,
                                              const std::array<double, 2>& blur) {
  const std::optional<Eigen::Matrix3d> H = tag_to_image(corners);
  if (!H) return std::nullopt;
  std::array<Edge, 4> edges;
  const double cell = 2.0 / layout.cells;
  for (std::size_t e = 0; e < 4; ++e) {
    const Eigen::Vector2d& a = corners[e];
    const Eigen::Vector2d& b = corners[(e + 1) % 4];
    Edge& edge = edges[e];
    edge.half = 0.5 * (b - a).norm();
    if (!(edge.half > 2.0)) return std::nullopt;
    edge.middle = 0.5 * (a + b);
    edge.along = (b - a) / (2.0 * edge.half);
    edge.outward = {-edge.along.y(), edge.along.x()};
    const auto depth = [&](double offset) {  // distance of the line one cell in or out, nearer end
      constexpr std::array<std::array<double, 4>, 4> kEnds = {
          {{-1, 1, 1, 1}, {1, 1, 1, -1}, {1, -1, -1, -1}, {-1, -1, -1, 1}}};
      const auto& [x0, y0, x1, y1] = kEnds[e];
      const bool vertical = e % 2 == 1;  // x is constant
      const double scale = 1.0 + offset;
      const Eigen::Vector2d p = vertical ? mapped(*H, scale * x0, y0) : mapped(*H, x0, scale * y0);
      const Eigen::Vector2d q = vertical ? mapped(*H, scale * x1, y1) : mapped(*H, x1, scale * y1);
      return std::min(std::abs(edge.outward.dot(p - edge.middle)),
                      std::abs(edge.outward.dot(q - edge.middle)));
    };
    edge.inner_width = strip_width(depth(-cell), blur[e % 2]);
    edge.outer_width = strip_width(depth(cell), blur[e % 2]);
  }
  return edges;
}

std::vector<Sample> collect_samples(const ImageView& image, const std::array<Edge, 4>& edges,
                                    const Corners& corners, const std::array<double, 2>& blur) {
  Eigen::Vector2d low = corners[0];
  Eigen::Vector2d high = corners[0];
  double reach = 0.0;
  for (std::size_t e = 0; e < 4; ++e) {
    low = low.cwiseMin(corners[e]);
    high = high.cwiseMax(corners[e]);
    reach = std::max({reach, edges[e].inner_width, edges[e].outer_width});
  }
  const int x0 = std::max(0, static_cast<int>(std::floor(low.x() - reach)));
  const int x1 = std::min(image.width - 1, static_cast<int>(std::ceil(high.x() + reach)));
  const int y0 = std::max(0, static_cast<int>(std::floor(low.y() - reach)));
  const int y1 = std::min(image.height - 1, static_cast<int>(std::ceil(high.y() + reach)));
  std::vector<Sample> samples;
  for (int y = y0; y <= y1; ++y) {
    const std::uint8_t* row = image.data + static_cast<std::ptrdiff_t>(image.stride) * y;
    std::array<double, 4> first{};  // distance outward of every edge, at x0
    for (std::size_t e = 0; e < 4; ++e)
      first[e] = edges[e].outward.dot(Eigen::Vector2d(x0, y) - edges[e].middle);
    for_each_in_strips(edges, first, x1 - x0, [&](int offset) {
      const int x = x0 + offset;
      std::array<double, 4> here{};
      for (std::size_t e = 0; e < 4; ++e) here[e] = first[e] + offset * edges[e].outward.x();
      for (std::size_t e = 0; e < 4; ++e) {
        const Edge& edge = edges[e];
        const double width = here[e] > 0.0 ? edge.outer_width : edge.inner_width;
        if (std::abs(here[e]) >= width) continue;
        // Away from both neighbouring edges by the reach of their blur.
        const double clear = kCornerReach * blur[(e + 1) % 2];
        const double nearest = -std::max(here[(e + 1) % 4], here[(e + 3) % 4]);
        if (nearest <= clear || nearest < std::abs(here[e]) * 0.5) continue;
        Sample s;
        s.edge = static_cast<int>(e);
        s.u = edge.along.dot(Eigen::Vector2d(x, y) - edge.middle) / edge.half;
        s.distance = here[e];
        s.grey = static_cast<double>(row[x]);
        s.weight = faded(width, std::abs(here[e])) * std::min(1.0, (nearest - clear) / kTaper);
        samples.push_back(s);
      }
    });
  }
  return samples;
}

}  // namespace kinescope::corner_fit
