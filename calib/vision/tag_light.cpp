// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tag_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "calib/vision/blurred_step.h"
#include "calib/vision/marker_cells.h"
#include "kinematics/core/median.h"

namespace kinescope::whole_tag {
namespace {

constexpr int kSharpenings = 6;  // rounds of undoing the blur
constexpr double kLeastOwn =
    0.6;                        // of its light that a cell's middle keeps; less does not converge
constexpr double kReach = 3.5;  // blurs, beyond which a step is over
constexpr int kMostLines = 8;   // 2 kReach kMostBlur, and one to spare
constexpr int kOrders = 5;      // of the normal distribution's derivatives, the first being itself
constexpr int kSpread = kOrders;  // place of what belongs to the spread, beside them

double as_number(Cell cell) { return cell == Cell::kBright ? 1.0 : 0.0; }

// std::floor is a call where the processor is not known to have it.
int floor_of(double x) {
  const int toward_zero = static_cast<int>(x);
  return toward_zero - (x < toward_zero ? 1 : 0);
}

// The normal distribution and its derivatives at z.
std::array<double, kOrders> derivatives(double z) {
  const auto [step, density] = corner_fit::BlurredStep::table().at(z);
  return {step, density, -z * density, (z * z - 1.0) * density, z * (3.0 - z * z) * density};
}

// Share of bright in every cell's middle, with what its neighbours lend undone (Van Cittert 1931).
Eigen::MatrixXd sharpened(const Eigen::MatrixXd& seen, const Eigen::Vector2d& blur_cells,
                          double around) {
  const auto own = [](double blur) {
    return std::max(kLeastOwn, 2.0 * corner_fit::BlurredStep::table().at(0.5 / blur).step - 1.0);
  };
  const double own_x = own(blur_cells.x());
  const double own_y = own(blur_cells.y());
  const Eigen::Index n = seen.rows();
  Eigen::MatrixXd padded = Eigen::MatrixXd::Constant(n + 2, n + 2, around);
  padded.block(1, 1, n, n) = seen;
  for (int round = 0; round < kSharpenings; ++round) {
    const Eigen::MatrixXd across = own_x * padded.middleRows(1, n) +
                                   0.5 * (1.0 - own_x) * (padded.topRows(n) + padded.bottomRows(n));
    const Eigen::MatrixXd blurred =
        own_y * across.middleCols(1, n) +
        0.5 * (1.0 - own_y) * (across.leftCols(n) + across.rightCols(n));
    padded.block(1, 1, n, n) =
        (padded.block(1, 1, n, n) + seen - blurred).cwiseMax(0.0).cwiseMin(1.0);
  }
  return padded.block(1, 1, n, n);
}

// The code's parts at a place: sums over the lines near it of steps times derivatives of order k
// along x and q along y.
class Parts {
 public:
  Parts(const TagCode& code, const TagPlace& place, const LocalBlur& blur)
      : code_(code),
        columns_(lines_near(place.x, kReach * blur.x, code.cells())),
        rows_(lines_near(place.y, kReach * blur.y, code.cells())) {
    for (int i = 0; i < columns_.count; ++i)
      along_x_[at(i)] = derivatives((place.x - columns_.line(i)) / blur.x);
    const int last = columns_.count > 0 ? kOrders + 1 : 1;  // without a line along x there is
    std::array<double, kOrders + 1> before = row(0);        // but the cell itself
    for (int k = 0; k < last; ++k) sum_[at(k)][0] = before[at(k)];
    for (int l = 0; l < rows_.count; ++l) {
      const std::array<double, kOrders> along = derivatives((place.y - rows_.line(l)) / blur.y);
      const std::array<double, kOrders + 1> after = row(l + 1);
      for (int k = 0; k < last; ++k) {
        const double step = after[at(k)] - before[at(k)];
        for (std::size_t q = 0; q < kOrders; ++q) sum_[at(k)][q] += step * along[q];
      }
      spread_y_ += steps_down(l) * along[1];
      before = after;
    }
  }

  [[nodiscard]] double operator()(std::size_t k, std::size_t q) const { return sum_[k][q]; }
  /// Of the steps along x, and along y, without their sign.
  [[nodiscard]] double spread_x() const { return sum_[kSpread][0]; }
  [[nodiscard]] double spread_y() const { return spread_y_; }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  // Row r of those near: its cells, blurred along x.
  [[nodiscard]] std::array<double, kOrders + 1> row(int r) const {
    std::array<double, kOrders + 1> out{};
    const int y = rows_.before + r;
    double last = as_number(code_.at(columns_.before, y));
    out[0] = last;
    for (int i = 0; i < columns_.count; ++i) {
      const double next = as_number(code_.at(columns_.line(i), y));
      const double step = next - last;
      last = next;
      if (step == 0.0) continue;
      for (std::size_t k = 0; k < kOrders; ++k) out[k] += step * along_x_[at(i)][k];
      out[kSpread] += along_x_[at(i)][1];
    }
    return out;
  }

  // The size of the steps over line l of the rows, blurred along x.
  [[nodiscard]] double steps_down(int l) const {
    const int y = rows_.before + l;
    const auto size = [&](int x) { return code_.at(x, y) == code_.at(x, y + 1) ? 0.0 : 1.0; };
    double last = size(columns_.before);
    double out = last;
    for (int i = 0; i < columns_.count; ++i) {
      const double next = size(columns_.line(i));
      out += (next - last) * along_x_[at(i)][0];
      last = next;
    }
    return out;
  }

  const TagCode& code_;
  LinesNear columns_;
  LinesNear rows_;
  std::array<std::array<double, kOrders>, kMostLines> along_x_;
  std::array<std::array<double, kOrders>, kOrders + 1> sum_{};
  double spread_y_ = 0.0;
};

}  // namespace

TagCode::TagCode(int cells, Cell around)
    : cells_(cells), code_(static_cast<std::size_t>((cells + 2) * (cells + 2)), around) {}

std::optional<SeenCode> read_code(const ImageView& image, const Eigen::Matrix3d& H,
                                  const TagLayout& layout, const Eigen::Vector2d& blur_cells) {
  const MarkerCells cells = read_cells(image, H, layout.cells);
  if (!cells.is_readable()) return std::nullopt;
  const Cell around = layout.dark_inside ? Cell::kBright : Cell::kDark;
  const Eigen::MatrixXd seen =
      (cells.level.array() - cells.level.minCoeff()).matrix() / cells.contrast;
  const Eigen::MatrixXd share = sharpened(seen, blur_cells, as_number(around));
  SeenCode out{TagCode(layout.cells, around), 0.0, 0.0};
  std::vector<double> dark;
  std::vector<double> bright;
  for (int row = 0; row < layout.cells; ++row) {
    for (int column = 0; column < layout.cells; ++column) {
      const double off = share(column, row) - 0.5;
      Cell cell = Cell::kUnclear;
      if (off < -kClearCell) {
        cell = Cell::kDark;
        dark.push_back(cells.level(column, row));
      } else if (off > kClearCell) {
        cell = Cell::kBright;
        bright.push_back(cells.level(column, row));
      }
      out.code.set(column, row, cell);
    }
  }
  if (dark.empty() || bright.empty()) return std::nullopt;
  out.dark = median_of(std::move(dark));
  out.bright = median_of(std::move(bright));
  return out;
}

LinesNear lines_near(double place, double reach, int cells) {
  const int first = std::max(0, -floor_of(reach - place));
  const int last = std::min(cells, floor_of(place + reach));
  if (last >= first) return {first - 1, last - first + 1};
  return {std::clamp(floor_of(place), -1, cells), 0};
}

LocalBlur local_blur(const TagPlace& place, const Eigen::Matrix2d& blur_px2) {
  const Eigen::Vector2d spread = blur_px2 * place.per_px_y;
  const double x = std::sqrt(place.per_px_x.dot(blur_px2 * place.per_px_x));
  const double y = std::sqrt(place.per_px_y.dot(spread));
  return {x, y, place.per_px_x.dot(spread) / (x * y)};
}

Share bright_share(const TagCode& code, const TagPlace& place, const Eigen::Matrix2d& blur_px2) {
  const LocalBlur blur = local_blur(place, blur_px2);
  const Parts m(code, place, blur);
  const double r1 = blur.correlation;
  const double r2 = r1 * r1 / 2.0;
  const double r3 = r2 * r1 / 3.0;
  Share out;
  out.value = m(0, 0) + r1 * m(1, 1) + r2 * m(2, 2) + r3 * m(3, 3);
  out.x = (m(1, 0) + r1 * m(2, 1) + r2 * m(3, 2)) / blur.x;
  out.y = (m(0, 1) + r1 * m(1, 2) + r2 * m(2, 3)) / blur.y;
  // A Gaussian's light obeys the heat equation in its covariance.
  const double xx = (m(2, 0) + r1 * m(3, 1)) / (blur.x * blur.x);
  const double yy = (m(0, 2) + r1 * m(1, 3)) / (blur.y * blur.y);
  const double xy = (m(1, 1) + r1 * m(2, 2) + r2 * m(3, 3)) / (blur.x * blur.y);
  const Eigen::Vector2d& a = place.per_px_x;
  const Eigen::Vector2d& b = place.per_px_y;
  out.blur << 0.5 * (a.x() * a.x() * xx + b.x() * b.x() * yy) + a.x() * b.x() * xy,
      a.x() * a.y() * xx + b.x() * b.y() * yy + (a.x() * b.y() + a.y() * b.x()) * xy,
      0.5 * (a.y() * a.y() * xx + b.y() * b.y() * yy) + a.y() * b.y() * xy;
  const double square_x = a.squaredNorm();
  const double square_y = b.squaredNorm();
  out.spread =
      m.spread_x() * std::sqrt(square_x) / blur.x + m.spread_y() * std::sqrt(square_y) / blur.y;
  const double xs = square_x / (blur.x * blur.x);
  const double ys = square_y / (blur.y * blur.y);
  const double both = 2.0 * a.dot(b) / (blur.x * blur.y);
  out.peak =
      (xs * xs * m(4, 0) + 2.0 * xs * both * m(3, 1) + (2.0 * xs * ys + both * both) * m(2, 2) +
       2.0 * ys * both * m(1, 3) + ys * ys * m(0, 4)) /
      24.0;
  return out;
}

}  // namespace kinescope::whole_tag
