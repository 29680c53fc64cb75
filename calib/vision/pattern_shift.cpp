// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/pattern_shift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "calib/vision/marker_cells.h"
#include "calib/vision/marker_edges.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

// What else moves cells against corners, measured on pictures of whole markers: pixels, blur from
// cells further on, noise (over contrast), and the lens, which bends edges by up to this, 1/px.
constexpr double kPixels = 0.2;  // px
constexpr double kShareOfCell = 0.03;
constexpr double kNoisePixels = 2.0;  // px
constexpr double kNoiseOfCell = 0.6;
constexpr double kBending = 4e-4;
constexpr double kClearShift = 5.0;  // standard deviations of the corners
// Of corners without a fit: few whole markers are left without one, so that little is lost.
constexpr double kClearOfStart = 3.0;
// What is read of a cell is this many blurs from the next one, where more than a point is left.
constexpr double kClearOfBlur = 2.2;
constexpr double kLeastOfCell = 0.05;

// A step between two cells, placed in the square [-1, 1]^2.
struct CellEdge {
  Eigen::Vector2d at;
  double shift = 0.0;    // across
  double to_dark = 0.0;  // 1 where the cell behind is the dark one, -1 where the one before is
};

// The marker's cells as the image shows them where H puts them, and the steps between them.
class Code {
 public:
  Code(const ImageView& image, const Eigen::Matrix3d& H, int cells, const ToneCurve& tone,
       double middle_of_cell)
      : image_(image),
        tone_(tone),
        middle_of_cell_(middle_of_cell),
        H_(H),
        count_(cells),
        width_(2.0 / cells),
        cells_(read_cells(image, H, cells, tone, middle_of_cell)) {}

  [[nodiscard]] bool is_readable() const { return cells_.is_readable(); }

  // Steps across direction 0 (x) or 1 (y).
  [[nodiscard]] std::vector<CellEdge> steps(int direction) const {
    std::vector<CellEdge> out;
    for (int i = 0; i + 1 < count_; ++i) {
      for (int j = 0; j < count_; ++j) {
        const double before = direction == 0 ? cells_.level(i, j) : cells_.level(j, i);
        const double after = direction == 0 ? cells_.level(i + 1, j) : cells_.level(j, i + 1);
        if (std::abs(after - before) < 0.5 * cells_.contrast) continue;
        const double across = middle(i) + 0.5 * width_;
        CellEdge step{{across, middle(j)},
                      shift(direction, across, middle(j), before, after),
                      after < before ? 1.0 : -1.0};
        if (direction == 1) std::swap(step.at.x(), step.at.y());
        out.push_back(step);
      }
    }
    return out;
  }

 private:
  [[nodiscard]] double middle(int i) const { return -1.0 + (i + 0.5) * width_; }

  [[nodiscard]] double light(const Eigen::Vector2d& at) const {
    return light_at(image_, (H_ * at.homogeneous()).hnormalized(), tone_);
  }

  // Where the step is by how much of the way between the two middles is like the first one.
  [[nodiscard]] double shift(int direction, double across, double along, double before,
                             double after) const {
    constexpr int kSamples = 12;
    double sum = 0.0;
    for (int k = 0; k < kSamples; ++k) {
      const double u = across + ((k + 0.5) / kSamples - 0.5) * width_;
      for (const double d : {-middle_of_cell_, 0.0, middle_of_cell_}) {
        const double v = along + d * width_;
        sum += direction == 0 ? light({u, v}) : light({v, u});
      }
    }
    const double mean = sum / (3.0 * kSamples);
    return (0.5 - (mean - before) / (after - before)) * width_;
  }

  const ImageView& image_;
  const ToneCurve& tone_;
  double middle_of_cell_;
  Eigen::Matrix3d H_;
  int count_;  // of cells along an edge
  double width_;
  MarkerCells cells_;
};

Eigen::Vector4d bilinear(const Eigen::Vector2d& at) {
  return {1.0, at.x(), at.y(), at.x() * at.y()};
}

template <int N>
using Numbers = Eigen::Matrix<double, N, 1>;

// What a step's shift is made of: the four numbers of a bilinear warp, and with a fifth one how far
// bright cells grow over dark ones.
template <int N>
Numbers<N> parts(const CellEdge& step) {
  if constexpr (N == 4) {
    return bilinear(step.at);
  } else {
    return (Numbers<5>() << bilinear(step.at), step.to_dark).finished();
  }
}

// Robust (Tukey's biweight): cells that are covered themselves tell nothing.
template <int N>
std::optional<Numbers<N>> fit(const std::vector<CellEdge>& steps) {
  constexpr int kReweightings = 5;
  constexpr double kTukey = 4.685;
  constexpr double kLeastScale = 1e-4;
  constexpr std::size_t kFewestSteps = 2 * N;
  if (steps.size() < kFewestSteps) return std::nullopt;
  Numbers<N> out = Numbers<N>::Zero();
  std::vector<double> size(steps.size());
  double scale = 0.0;
  for (int round = 0; round <= kReweightings; ++round) {
    Eigen::Matrix<double, N, N> H = Eigen::Matrix<double, N, N>::Zero();
    Numbers<N> g = Numbers<N>::Zero();
    for (const CellEdge& step : steps) {
      const Numbers<N> row = parts<N>(step);
      const double off = round == 0 ? 0.0 : (step.shift - row.dot(out)) / (kTukey * scale);
      const double weight = std::pow(std::max(0.0, 1.0 - off * off), 2);
      H += weight * row * row.transpose();
      g += weight * row * step.shift;
    }
    const Eigen::LLT<Eigen::Matrix<double, N, N>> solver(H);
    if (solver.info() != Eigen::Success) return std::nullopt;
    out = solver.solve(g);
    for (std::size_t i = 0; i < steps.size(); ++i)
      size[i] = std::abs(steps[i].shift - parts<N>(steps[i]).dot(out));
    // As many of them as there are numbers could be made nothing.
    const auto middle = size.begin() + static_cast<std::ptrdiff_t>((size.size() + N) / 2);
    std::ranges::nth_element(size, middle);
    scale = std::max(kSigmaOverMedian * *middle, kLeastScale);
  }
  return out;
}

double edge_px(const Corners& corners, std::size_t e) {
  return (corners[(e + 1) % 4] - corners[e]).norm();
}

}  // namespace

std::optional<double> pattern_shift(const ImageView& image, const Corners& corners,
                                    const TagLayout& layout) {
  const std::optional<Eigen::Matrix3d> H = corner_fit::tag_to_image(corners);
  if (!H) return std::nullopt;
  const ToneCurve linear;
  const Code code(image, *H, layout.cells, linear, kMiddleOfCell);
  if (!code.is_readable()) return std::nullopt;
  const std::optional<Eigen::Vector4d> x = fit<4>(code.steps(0));
  const std::optional<Eigen::Vector4d> y = fit<4>(code.steps(1));
  if (!x || !y) return std::nullopt;

  // Of both ends of every edge.
  std::array<double, 8> outward{};
  for (std::size_t e = 0; e < 4; ++e) {
    const Eigen::Vector4d& across = e % 2 == 0 ? *y : *x;
    const double sign = e < 2 ? 1.0 : -1.0;
    for (std::size_t end = 0; end < 2; ++end) {
      const double moved = bilinear(corner_fit::kSquare[(e + end) % 4]).dot(across);
      // The edge that meets this one here is what it shifts along.
      outward[2 * e + end] = sign * moved * 0.5 * edge_px(corners, (e + (end == 0 ? 3 : 1)) % 4);
    }
  }
  const double mean = std::accumulate(outward.begin(), outward.end(), 0.0) / 8.0;
  double largest = 0.0;
  for (const double shift : outward) largest = std::max(largest, std::abs(shift - mean));
  return largest;
}

std::optional<PatternBloom> pattern_bloom(const ImageView& image, const Corners& corners,
                                          const TagLayout& layout, const ToneCurve& tone,
                                          double blur_px) {
  const std::optional<Eigen::Matrix3d> H = corner_fit::tag_to_image(corners);
  if (!H) return std::nullopt;
  double edges = 0.0;
  for (std::size_t e = 0; e < 4; ++e) edges += edge_px(corners, e);
  const double cell = 0.25 * edges / layout.cells;
  const double middle =
      std::clamp(0.5 - kClearOfBlur * blur_px / cell, kLeastOfCell, kMiddleOfCell);
  const Code code(image, *H, layout.cells, tone, middle);
  if (!code.is_readable()) return std::nullopt;
  const std::optional<Numbers<5>> x = fit<5>(code.steps(0));
  const std::optional<Numbers<5>> y = fit<5>(code.steps(1));
  if (!x || !y) return std::nullopt;
  const double half = edges / 8.0;
  return PatternBloom{0.5 * half * ((*x)(4) + (*y)(4)), 0.5 * half * ((*x)(1) + (*y)(2))};
}

bool is_partly_hidden(const ImageView& image, const RefinedCorners& border, const TagLayout& layout,
                      double start_sigma_px) {
  if (border.status == RefineStatus::kNotRun || border.status == RefineStatus::kTooFewPixels)
    return false;
  double longest = 0.0;
  double shortest = edge_px(border.corners_px, 0);
  for (std::size_t e = 0; e < 4; ++e) {
    longest = std::max(longest, edge_px(border.corners_px, e));
    shortest = std::min(shortest, edge_px(border.corners_px, e));
  }
  const double cell = longest / layout.cells;
  double elsewhere = kPixels + kShareOfCell * cell + kBending * longest * longest / 8.0;
  if (border.status == RefineStatus::kDone) {
    if (border.blur_px > corner_fit::kSharp * shortest / layout.cells) return false;
    elsewhere += border.noise / border.contrast * (kNoisePixels + kNoiseOfCell * cell) +
                 kClearShift * border.sigma_px;
  } else {
    elsewhere += kClearOfStart * start_sigma_px;
  }
  const std::optional<double> shift = pattern_shift(image, border.corners_px, layout);
  return shift && *shift > elsewhere;
}

}  // namespace kinescope
