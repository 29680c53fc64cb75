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

namespace kinescope {
namespace {

constexpr std::size_t kFewestSteps = 8;  // in each direction, for the four numbers of the warp
// What else moves cells against corners, measured on pictures of whole markers: pixels, blur from
// cells further on, noise (over contrast), and the lens, which bends edges by up to this, 1/px.
constexpr double kPixels = 0.2;  // px
constexpr double kShareOfCell = 0.03;
constexpr double kNoisePixels = 2.0;  // px
constexpr double kNoiseOfCell = 0.6;
constexpr double kBending = 4e-4;
constexpr double kClear = 5.0;  // standard deviations of the corners
// Of corners without a fit: few whole markers are left without one, so that little is lost.
constexpr double kClearOfStart = 3.0;
// Where the blur is more than this share of a cell, steps cannot be told from one another.
constexpr double kSharp = 0.2;

// A step between two cells, placed in the square [-1, 1]^2.
struct Step {
  Eigen::Vector2d at;
  double shift = 0.0;  // across
};

// The marker's cells as the image shows them where H puts them, and the steps between them.
class Code {
 public:
  Code(const ImageView& image, const Eigen::Matrix3d& H, int cells)
      : image_(image),
        H_(H),
        count_(cells),
        width_(2.0 / cells),
        cells_(read_cells(image, H, cells)) {}

  [[nodiscard]] bool is_readable() const { return cells_.is_readable(); }

  // Steps across direction 0 (x) or 1 (y).
  [[nodiscard]] std::vector<Step> steps(int direction) const {
    std::vector<Step> out;
    for (int i = 0; i + 1 < count_; ++i) {
      for (int j = 0; j < count_; ++j) {
        const double before = direction == 0 ? cells_.level(i, j) : cells_.level(j, i);
        const double after = direction == 0 ? cells_.level(i + 1, j) : cells_.level(j, i + 1);
        if (std::abs(after - before) < 0.5 * cells_.contrast) continue;
        const double across = middle(i) + 0.5 * width_;
        Step step{{across, middle(j)}, shift(direction, across, middle(j), before, after)};
        if (direction == 1) std::swap(step.at.x(), step.at.y());
        out.push_back(step);
      }
    }
    return out;
  }

 private:
  [[nodiscard]] double middle(int i) const { return -1.0 + (i + 0.5) * width_; }

  [[nodiscard]] double grey(const Eigen::Vector2d& at) const {
    return grey_at(image_, (H_ * at.homogeneous()).hnormalized());
  }

  // Where the step is by how much of the way between the two middles is like the first one.
  [[nodiscard]] double shift(int direction, double across, double along, double before,
                             double after) const {
    constexpr int kSamples = 12;
    double sum = 0.0;
    for (int k = 0; k < kSamples; ++k) {
      const double u = across + ((k + 0.5) / kSamples - 0.5) * width_;
      for (const double d : {-kMiddleOfCell, 0.0, kMiddleOfCell}) {
        const double v = along + d * width_;
        sum += direction == 0 ? grey({u, v}) : grey({v, u});
      }
    }
    const double mean = sum / (3.0 * kSamples);
    return (0.5 - (mean - before) / (after - before)) * width_;
  }

  const ImageView& image_;
  Eigen::Matrix3d H_;
  int count_;  // of cells along an edge
  double width_;
  MarkerCells cells_;
};

Eigen::Vector4d bilinear(const Eigen::Vector2d& at) {
  return {1.0, at.x(), at.y(), at.x() * at.y()};
}

// Bilinear shifts, robust (Tukey's biweight): cells that are covered themselves tell nothing.
std::optional<Eigen::Vector4d> fit(const std::vector<Step>& steps) {
  constexpr int kReweightings = 5;
  constexpr double kTukey = 4.685;
  constexpr double kLeastScale = 1e-4;
  if (steps.size() < kFewestSteps) return std::nullopt;
  Eigen::Vector4d out = Eigen::Vector4d::Zero();
  std::vector<double> size(steps.size());
  double scale = 0.0;
  for (int round = 0; round <= kReweightings; ++round) {
    Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
    Eigen::Vector4d g = Eigen::Vector4d::Zero();
    for (const Step& step : steps) {
      const Eigen::Vector4d row = bilinear(step.at);
      const double off = round == 0 ? 0.0 : (step.shift - row.dot(out)) / (kTukey * scale);
      const double weight = std::pow(std::max(0.0, 1.0 - off * off), 2);
      H += weight * row * row.transpose();
      g += weight * row * step.shift;
    }
    const Eigen::LLT<Eigen::Matrix4d> solver(H);
    if (solver.info() != Eigen::Success) return std::nullopt;
    out = solver.solve(g);
    for (std::size_t i = 0; i < steps.size(); ++i)
      size[i] = std::abs(steps[i].shift - bilinear(steps[i].at).dot(out));
    // Four of them could be made nothing.
    const auto middle = size.begin() + static_cast<std::ptrdiff_t>((size.size() + 4) / 2);
    std::ranges::nth_element(size, middle);
    scale = std::max(1.4826 * *middle, kLeastScale);
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
  const Code code(image, *H, layout.cells);
  if (!code.is_readable()) return std::nullopt;
  const std::optional<Eigen::Vector4d> x = fit(code.steps(0));
  const std::optional<Eigen::Vector4d> y = fit(code.steps(1));
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
    if (border.blur_px > kSharp * shortest / layout.cells) return false;
    elsewhere += border.noise / border.contrast * (kNoisePixels + kNoiseOfCell * cell) +
                 kClear * border.sigma_px;
  } else {
    elsewhere += kClearOfStart * start_sigma_px;
  }
  const std::optional<double> shift = pattern_shift(image, border.corners_px, layout);
  return shift && *shift > elsewhere;
}

}  // namespace kinescope
