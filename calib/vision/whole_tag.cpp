// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/whole_tag.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>

#include "calib/vision/marker_edges.h"
#include "calib/vision/tag_light.h"
#include "calib/vision/tone_table.h"
#include "calib/vision/undistorted_patch.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

using namespace whole_tag;
using corner_fit::kCodecBlock;
using corner_fit::kMinNoise;
using corner_fit::kRobust;
using corner_fit::kTaper;

// Places of the unknowns. Each is a step from what the model has now.
constexpr int kHomography = 0;  // 8: shift, affine and perspective parts, px at the border
constexpr int kBlur = 8;        // xx, xy, yy, px^2
constexpr int kGamma = 11;
constexpr int kSpread = 12;  // px
constexpr int kPeak = 13;    // px^4
constexpr int kDark = 14;    // 3: in the middle, along x and y
constexpr int kBright = 17;  // 3
constexpr int kBowl = 20;    // 3: x^2, x y, y^2
constexpr int kUnknowns = 23;
constexpr int kSize = 24;  // the same with what fills it up to a multiple of 4

constexpr double kReach = 2.5;          // blurs from a step, of pixels that are used
constexpr double kMinOuterWidth = 1.1;  // px around the border that are used at least ..
constexpr double kOuterReach = 2.0;     // .. and at most these blurs less than a cell
constexpr std::size_t kFewestPixels = 112;
constexpr std::size_t kEnough = 250;  // pixels to come near with
constexpr std::size_t kCoarse = 4;    // one in so many pixels

// What is known beforehand, standard deviations.
constexpr double kBlurMean = 0.64;   // px^2
constexpr double kBlurBelief = 1.0;  // px^2
constexpr double kGammaSigma = 0.8;
constexpr double kKnownGammaSigma = 0.1;
constexpr double kSpreadSigma = 0.03;  // px: ink, where the tone curve is not
constexpr double kPeakSigma = 0.5;     // px^4: motion flattens a blur, sharpening peaks it
constexpr double kBowlSigma = 0.1;     // of the contrast

constexpr double kLeastBlur = 0.0625;  // px^2, below the pixel's own 1/12
constexpr double kLeastGamma = 0.4;
constexpr double kMostFittedGamma = 4.0;
constexpr double kMostPeak = 2.0;  // px^4
constexpr int kMostApproaches = 5;
constexpr double kMostMove = 0.5;   // cells; beyond, it is another code
constexpr double kMostNoise = 1.6;  // of the border's: compressed pictures stay below 1.4, a shadow
                                    // across the marker or a cover is beyond 3
// A step below all of these changes the slopes too little to compute them anew.
constexpr double kSmallMove = 0.05;  // px
constexpr double kSmallBlur = 0.06;  // px^2
constexpr double kSmallGamma = 0.15;
constexpr double kSmallPeak = 0.3;

using Row = Eigen::Matrix<float, kSize, 1>;
using System = Eigen::Matrix<double, kSize, kSize>;
using ParameterStep = Eigen::Matrix<double, kSize, 1>;

struct Pixel {
  double x = 0.0;
  double y = 0.0;
  double grey = 0.0;
  double weight = 0.0;
  int block = 0;
  bool is_coarse = false;
};

// Adds w s s' of `count` pixels to A's lower triangle; four at a time, so that A is loaded once.
void add_products(const Row* slopes, const float* weights, std::size_t count, System& H) {
  std::array<float, static_cast<std::size_t>(kSize * kSize)> A{};
  for (std::size_t p = 0; p < count; p += 4) {
    std::array<const float*, 4> s{};
    std::array<float, 4> w{};
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t i = std::min(p + k, count - 1);
      s[k] = slopes[i].data();
      w[k] = p + k < count ? weights[i] : 0.0F;
    }
    for (int row = 0; row < kSize; ++row) {
      const float a = w[0] * s[0][row];
      const float b = w[1] * s[1][row];
      const float c = w[2] * s[2][row];
      const float d = w[3] * s[3][row];
      float* out = A.data() + row * kSize;
      const int end = (row | 3) + 1;
      for (int column = 0; column < end; ++column)
        out[column] += a * s[0][column] + b * s[1][column] + c * s[2][column] + d * s[3][column];
    }
  }
  for (int row = 0; row < kSize; ++row) {
    for (int column = 0; column <= row; ++column)
      H(row, column) += static_cast<double>(A[static_cast<std::size_t>(row * kSize + column)]);
  }
}

Eigen::AlignedBox2d box_of(const Corners& corners) {
  Eigen::AlignedBox2d out;
  for (const Eigen::Vector2d& corner : corners) out.extend(corner);
  return out;
}

class WholeTagFit {
 public:
  WholeTagFit(const ImageView& image, const RefinedCorners& border, const TagLayout& layout,
              const ToneCurve& tone, const CameraModel& lens)
      : image_(image),
        border_(border),
        layout_(layout),
        lens_(lens),
        gamma_sigma_(tone.is_linear() ? kGammaSigma : kKnownGammaSigma),
        likely_gamma_(tone.gamma()),
        gamma_(tone.gamma()),
        code_(layout.cells, Cell::kUnclear) {}

  std::optional<RefinedCorners> run() {
    if (!begin() || !collect()) return std::nullopt;
    // Most of the way with a part of the pixels.
    if (!approach(coarse_)) return std::nullopt;
    const std::optional<ParameterStep> step = approach(pixels_.size());
    if (!step) return std::nullopt;
    const Row last = step->cast<float>();
    for (std::size_t i = 0; i < used_; ++i)
      residuals_[i] -= static_cast<double>(slopes_[i].dot(last));
    if (!weigh()) return std::nullopt;
    return judged();
  }

 private:
  bool begin() {
    const Corners& seen_corners = border_.corners_px;
    const std::optional<Eigen::Matrix3d> seen_H = corner_fit::tag_to_image(seen_corners);
    if (!seen_H) return false;
    blur_ = std::max(kLeastBlur, border_.blur_px * border_.blur_px) * Eigen::Matrix2d::Identity();
    margin_ = std::max(kMinOuterWidth, kReach * std::sqrt(blur_(0, 0))) + 1.0;
    box_ = box_of(seen_corners);
    box_.min().array() -= margin_;
    box_.max().array() += margin_;
    if (!(box_.min().minCoeff() > 0.0) || !(box_.max().x() < image_.width - 1) ||
        !(box_.max().y() < image_.height - 1))
      return false;
    patch_ = UndistortedPatch::over(lens_, box_);
    if (!patch_) return false;
    Corners corners = seen_corners;
    for (Eigen::Vector2d& corner : corners) corner = patch_->row(corner.y()).at(corner.x());
    const std::optional<Eigen::Matrix3d> H = corner_fit::tag_to_image(corners);
    if (!H) return false;
    H_ = *H;
    inverse_ = H_.inverse();
    for (std::size_t e = 0; e < 4; ++e) side_ += 0.25 * (corners[(e + 1) % 4] - corners[e]).norm();
    const Eigen::Vector2d middle = H_.col(2).hnormalized();
    const LocalBlur blur = local_blur(place(middle.x(), middle.y()).on_tag, blur_);
    if (!(std::max(blur.x, blur.y) < kMostBlur)) return false;
    const std::optional<SeenCode> seen = read_code(image_, *seen_H, layout_, {blur.x, blur.y});
    if (!seen || !(seen->bright - seen->dark > corner_fit::kMinContrast)) return false;
    code_ = seen->code;
    dark_(0) = seen->dark;
    bright_(0) = seen->bright;
    return true;
  }

  struct Place {
    double x = 0.0;  // in the square
    double y = 0.0;
    TagPlace on_tag;
  };

  [[nodiscard]] Place place(double px, double py) const {
    const Eigen::Matrix3d& M = inverse_;
    const double d = 1.0 / (M(2, 0) * px + M(2, 1) * py + M(2, 2));
    const double half = 0.5 * layout_.cells;
    Place p;
    p.x = (M(0, 0) * px + M(0, 1) * py + M(0, 2)) * d;
    p.y = (M(1, 0) * px + M(1, 1) * py + M(1, 2)) * d;
    p.on_tag.per_px_x = half * d * (M.block<1, 2>(0, 0) - p.x * M.block<1, 2>(2, 0)).transpose();
    p.on_tag.per_px_y = half * d * (M.block<1, 2>(1, 0) - p.y * M.block<1, 2>(2, 0)).transpose();
    p.on_tag.x = half * (p.x + 1.0);
    p.on_tag.y = half * (p.y + 1.0);
    return p;
  }

  // The pixels near steps between dark and bright.
  bool collect() {
    const int x0 = static_cast<int>(box_.min().x());
    const int x1 = static_cast<int>(box_.max().x());
    const int y0 = static_cast<int>(box_.min().y());
    const int y1 = static_cast<int>(box_.max().y());
    const int block_columns = x1 / kCodecBlock - x0 / kCodecBlock + 1;
    blocks_ = static_cast<std::size_t>(block_columns * (y1 / kCodecBlock - y0 / kCodecBlock + 1));
    std::size_t unclear = 0;
    for (int y = y0; y <= y1; ++y) {
      const UndistortedPatch::Row patch_row = patch_->row(y);
      const std::uint8_t* row = image_.data + static_cast<std::ptrdiff_t>(image_.stride) * y;
      const int block_row = (y / kCodecBlock - y0 / kCodecBlock) * block_columns;
      const auto [first, last] = span(y);
      for (int x = std::max(x0, first); x <= std::min(x1, last); ++x) {
        const Eigen::Vector2d at = patch_row.at(x);
        const auto [weight, is_clear] = weight_at(place(at.x(), at.y()).on_tag);
        if (!is_clear) ++unclear;
        if (!(weight > 0.0)) continue;
        pixels_.push_back({at.x(), at.y(), static_cast<double>(row[x]), weight,
                           block_row + x / kCodecBlock - x0 / kCodecBlock, (x + 2 * y) % 4 == 0});
      }
    }
    if (pixels_.size() <= kFewestPixels || unclear >= pixels_.size()) return false;
    if (pixels_.size() < kCoarse * kEnough) {
      coarse_ = pixels_.size();
      return true;
    }
    const auto rest =
        std::ranges::stable_partition(pixels_, [](const Pixel& pixel) { return pixel.is_coarse; });
    coarse_ = static_cast<std::size_t>(rest.begin() - pixels_.begin());
    return true;
  }

  // Where a row of pixels passes the marker with its margin.
  [[nodiscard]] std::pair<int, int> span(int y) const {
    double low = box_.max().x();
    double high = box_.min().x();
    for (std::size_t e = 0; e < 4; ++e) {
      const Eigen::Vector2d& a = border_.corners_px[e];
      const Eigen::Vector2d along = border_.corners_px[(e + 1) % 4] - a;
      const double above = (y - margin_ - a.y()) / along.y();  // +-infinity along a row
      const double below = (y + margin_ - a.y()) / along.y();
      const double from = std::max(0.0, std::min(above, below));
      const double to = std::min(1.0, std::max(above, below));
      if (!(from <= to)) continue;
      for (const double t : {from, to}) {
        low = std::min(low, a.x() + t * along.x());
        high = std::max(high, a.x() + t * along.x());
      }
    }
    return {static_cast<int>(low - margin_), static_cast<int>(high + margin_)};
  }

  struct Weight {
    double weight = 0.0;
    bool is_clear = true;
  };

  [[nodiscard]] Weight weight_at(const TagPlace& at) const {
    const int n = layout_.cells;
    const auto is_beside = [&](double place) { return place < -1.0 || place > n + 1.0; };
    if (is_beside(at.x) || is_beside(at.y)) return {};
    // The cheap question first: most pixels are near no line, or far outside.
    const double square_x = kReach * kReach * at.per_px_x.dot(blur_ * at.per_px_x);
    const double square_y = kReach * kReach * at.per_px_y.dot(blur_ * at.per_px_y);
    const auto is_off = [](double place, double square) {
      const double off = place - static_cast<int>(place + 1.5) + 1.0;  // from the nearest line
      return off * off > square;
    };
    if (is_off(at.x, square_x) && is_off(at.y, square_y)) return {};
    const LinesNear columns = lines_near(at.x, std::sqrt(square_x), n);
    const LinesNear rows = lines_near(at.y, std::sqrt(square_y), n);
    std::array<bool, 3> has{};
    for (int r = 0; r <= rows.count; ++r) {
      for (int c = 0; c <= columns.count; ++c)
        has[static_cast<std::size_t>(code_.at(columns.before + c, rows.before + r))] = true;
    }
    if (has[static_cast<std::size_t>(Cell::kUnclear)]) return {0.0, false};
    if (!has[static_cast<std::size_t>(Cell::kDark)] ||
        !has[static_cast<std::size_t>(Cell::kBright)])
      return {};
    // Outside no further than the quiet zone is sure to reach.
    const auto inside = [&](double place, const Eigen::Vector2d& per_px) {
      const double out = std::max(-place, place - n);
      if (out <= 0.0) return 1.0;
      const double cell = 1.0 / per_px.norm();
      const double zone = std::max(
          kMinOuterWidth, cell - kOuterReach * std::sqrt(per_px.dot(blur_ * per_px)) * cell);
      return std::clamp((zone - out * cell) / kTaper, 0.0, 1.0);
    };
    const double t = std::min(inside(at.x, at.per_px_x), inside(at.y, at.per_px_y));
    return {t * t * (3.0 - 2.0 * t), true};
  }

  // Steps with the first `count` pixels until they are small, and the last of them.
  std::optional<ParameterStep> approach(std::size_t count) {
    used_ = count;
    for (int round = 0; round < kMostApproaches; ++round) {
      compare();
      std::optional<ParameterStep> step = solve();
      if (!step) return std::nullopt;
      take(*step);
      if (is_small(*step)) return step;
    }
    return std::nullopt;
  }

  // Residuals and slopes.
  void compare() {
    const double per_px = layout_.cells / side_;
    inverse_ = H_.inverse();
    const ToneTable tone(dark_(0), bright_(0), gamma_);
    residuals_.resize(used_);
    slopes_.resize(used_);
    for (std::size_t i = 0; i < used_; ++i) {
      const Pixel& pixel = pixels_[i];
      const Place p = place(pixel.x, pixel.y);
      const Share share = bright_share(code_, p.on_tag, blur_);
      const ToneTable::Value t = tone.at(share.value + spread_ * share.spread + peak_ * share.peak);
      const double bowl = bowl_(0) * p.x * p.x + bowl_(1) * p.x * p.y + bowl_(2) * p.y * p.y;
      const double ratio = dark_(0) / bright_(0);
      const double dark = dark_(0) + dark_(1) * p.x + dark_(2) * p.y + ratio * bowl;
      const double contrast = bright_(0) + bright_(1) * p.x + bright_(2) * p.y + bowl - dark;
      residuals_[i] = pixel.grey - dark - contrast * t.value;
      const double w = contrast * t.slope;
      const double x = w * per_px * share.x;
      const double y = w * per_px * share.y;
      const double pull = x * p.x + y * p.y;
      const double off = 1.0 - t.value;
      const double both = t.value + off * ratio;
      ParameterStep s;
      s << x, x * p.x, x * p.y, y, y * p.x, y * p.y, pull * p.x, pull * p.y, w * share.blur,
          contrast * t.per_gamma, w * share.spread, w * share.peak, off, off * p.x, off * p.y,
          t.value, t.value * p.x, t.value * p.y, both * p.x * p.x, both * p.x * p.y,
          both * p.y * p.y, 0.0;
      slopes_[i] = s.cast<float>();
    }
  }

  std::optional<ParameterStep> solve() {
    std::vector<double> size;
    size.reserve(coarse_);
    for (std::size_t i = 0; i < coarse_; ++i) size.push_back(std::abs(residuals_[i]));
    noise_ = std::max(kMinNoise, kSigmaOverMedian * median_of(std::move(size)));
    if (!weigh()) return std::nullopt;
    Row pull = Row::Zero();
    for (const Row& block : pulls_) pull += block;
    ParameterStep g = pull.cast<double>();
    seen_ = System::Zero();
    add_products(slopes_.data(), weights_.data(), used_, seen_);
    const ParameterStep believed = variance_ * beliefs();
    solver_.compute(seen_ + System(believed.asDiagonal()));
    if (solver_.info() != Eigen::Success) return std::nullopt;
    g += believed.cwiseProduct(likely() - values());
    ParameterStep step = solver_.solve(g);
    const double longest = step.segment<8>(kHomography).cwiseAbs().maxCoeff();
    if (!(longest < kMostMove * side_ / layout_.cells)) return std::nullopt;
    return step;
  }

  // Robust weights of the residuals, their variance, and how they pull.
  bool weigh() {
    pulls_.assign(blocks_, Row::Zero());
    weights_.resize(used_);
    double cost = 0.0;
    double weight = 0.0;
    const double limit = kRobust * noise_;
    for (std::size_t i = 0; i < used_; ++i) {
      const double r = residuals_[i];
      const double w = pixels_[i].weight * (std::abs(r) > limit ? limit / std::abs(r) : 1.0);
      weights_[i] = static_cast<float>(w);
      pulls_[static_cast<std::size_t>(pixels_[i].block)] += static_cast<float>(w * r) * slopes_[i];
      cost += w * r * r;
      weight += w;
    }
    if (!(weight > 2.0 * kUnknowns)) return false;
    variance_ = std::max(cost / (weight - kUnknowns), kMinNoise * kMinNoise);
    return true;
  }

  // The unknowns about which something is known beforehand, the others being zero.
  [[nodiscard]] ParameterStep values() const {
    ParameterStep out = ParameterStep::Zero();
    out.segment<3>(kBlur) << blur_(0, 0), blur_(0, 1), blur_(1, 1);
    out(kGamma) = gamma_;
    out(kSpread) = spread_;
    out(kPeak) = peak_;
    out.segment<3>(kBowl) = bowl_;
    return out;
  }

  [[nodiscard]] ParameterStep likely() const {
    ParameterStep out = ParameterStep::Zero();
    out(kBlur) = out(kBlur + 2) = kBlurMean;
    out(kGamma) = likely_gamma_;
    return out;
  }

  // 1 / sigma^2.
  [[nodiscard]] ParameterStep beliefs() const {
    ParameterStep sigma = ParameterStep::Zero();
    sigma.segment<3>(kBlur).setConstant(kBlurBelief);
    sigma(kGamma) = gamma_sigma_;
    sigma(kSpread) = kSpreadSigma;
    sigma(kPeak) = kPeakSigma;
    sigma.segment<3>(kBowl).setConstant(kBowlSigma * (bright_(0) - dark_(0)));
    ParameterStep out = ParameterStep::Zero();
    for (int i = 0; i < kUnknowns; ++i) out(i) = sigma(i) > 0.0 ? 1.0 / (sigma(i) * sigma(i)) : 0.0;
    out(kUnknowns) = 1.0;
    return out;
  }

  void take(const ParameterStep& d) {
    const double s = 2.0 / side_;
    Eigen::Matrix3d G;  // the square as it is seen to the one that fits
    G << 1.0 + s * d(1), s * d(2), s * d(0), s * d(4), 1.0 + s * d(5), s * d(3), -s * d(6),
        -s * d(7), 1.0;
    H_ = H_ * G.inverse();
    blur_(0, 0) += d(kBlur);
    blur_(0, 1) += d(kBlur + 1);
    blur_(1, 1) += d(kBlur + 2);
    blur_(1, 0) = blur_(0, 1);
    keep_blur();
    gamma_ = std::clamp(gamma_ + d(kGamma), kLeastGamma, kMostFittedGamma);
    spread_ += d(kSpread);
    peak_ = std::clamp(peak_ + d(kPeak), -kMostPeak, kMostPeak);
    dark_ += d.segment<3>(kDark);
    bright_ += d.segment<3>(kBright);
    bright_(0) = std::max(bright_(0), dark_(0) + corner_fit::kMinContrast);
    bowl_ += d.segment<3>(kBowl);
  }

  static bool is_small(const ParameterStep& d) {
    return d.segment<8>(kHomography).cwiseAbs().maxCoeff() < kSmallMove &&
           d.segment<3>(kBlur).cwiseAbs().maxCoeff() < kSmallBlur &&
           std::abs(d(kGamma)) < kSmallGamma && std::abs(d(kPeak)) < kSmallPeak;
  }

  // No eigenvalue below the least.
  void keep_blur() {
    const double mean = 0.5 * (blur_(0, 0) + blur_(1, 1));
    const double half = 0.5 * (blur_(0, 0) - blur_(1, 1));
    const double radius = std::hypot(half, blur_(0, 1));
    if (mean - radius >= kLeastBlur) return;
    const double high = std::max(mean + radius, kLeastBlur);
    const double scale = radius > 0.0 ? 0.5 * (high - kLeastBlur) / radius : 0.0;
    blur_(0, 0) = 0.5 * (high + kLeastBlur) + scale * half;
    blur_(1, 1) = 0.5 * (high + kLeastBlur) - scale * half;
    blur_(0, 1) = blur_(1, 0) = scale * blur_(0, 1);
  }

  std::optional<RefinedCorners> judged() const {
    const double noise = std::sqrt(variance_);
    if (noise > kMostNoise * std::max(border_.noise, kMinNoise)) return std::nullopt;
    RefinedCorners out = border_;
    for (std::size_t c = 0; c < 4; ++c) {
      const auto corner =
          distorted(lens_, (H_ * corner_fit::kSquare[c].homogeneous()).hnormalized());
      if (!corner) return std::nullopt;
      out.corners_px[c] = *corner;
      const double moved = (out.corners_px[c] - border_.corners_px[c]).norm();
      if (!(moved < kMostMove * side_ / layout_.cells)) return std::nullopt;
    }
    out.by_cells = true;
    out.noise = noise;
    out.sigma_px = std::hypot(predicted_sigma(), corner_fit::kFloorSigma);
    const double mean = 0.5 * (blur_(0, 0) + blur_(1, 1));
    out.blur_px = std::sqrt(mean + std::hypot(0.5 * (blur_(0, 0) - blur_(1, 1)), blur_(0, 1)));
    return out;
  }

  // Neighbouring pixels err together: the scatter of the blocks' pulls, where it is more than that
  // of independent pixels.
  [[nodiscard]] double predicted_sigma() const {
    Eigen::Matrix<double, kSize, 8> lever = Eigen::Matrix<double, kSize, 8>::Zero();
    for (int c = 0; c < 4; ++c) {
      const Eigen::Vector2d& at = corner_fit::kSquare[static_cast<std::size_t>(c)];
      const Eigen::Vector3d q = H_ * at.homogeneous();
      Eigen::Matrix2d J;
      for (int k = 0; k < 2; ++k)
        J.col(k) = (H_.col(k).head<2>() - H_(2, k) * q.head<2>() / q.z()) / q.z();
      Eigen::Matrix<double, 2, 8> field;
      field << 1.0, at.x(), at.y(), 0.0, 0.0, 0.0, at.x() * at.x(), at.x() * at.y(),  //
          0.0, 0.0, 0.0, 1.0, at.x(), at.y(), at.x() * at.y(), at.y() * at.y();
      lever.block<8, 2>(kHomography, 2 * c) = (-2.0 / side_ * J * field).transpose();
    }
    const Eigen::Matrix<double, kSize, 8> response = solver_.solve(lever);
    const double alone = variance_ * lever.cwiseProduct(response).sum();
    double together = 0.0;
    for (const Row& block : pulls_)
      together += (response.transpose() * block.cast<double>()).squaredNorm();
    return std::sqrt(std::max(alone, together) / 8.0);
  }

  const ImageView& image_;
  const RefinedCorners& border_;
  const TagLayout& layout_;
  const CameraModel& lens_;
  double margin_ = 0.0;      // px around the marker
  Eigen::AlignedBox2d box_;  // of the pixels that may be used
  std::optional<UndistortedPatch> patch_;
  double gamma_sigma_;
  double likely_gamma_;
  // The model.
  Eigen::Matrix3d H_ = Eigen::Matrix3d::Identity();  // square to px
  Eigen::Matrix3d inverse_ = Eigen::Matrix3d::Identity();
  double side_ = 0.0;  // px
  Eigen::Matrix2d blur_ = Eigen::Matrix2d::Identity();
  double gamma_;
  double spread_ = 0.0;
  double peak_ = 0.0;
  Eigen::Vector3d dark_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d bright_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d bowl_ = Eigen::Vector3d::Zero();
  TagCode code_;
  // The pixels, and how they compare.
  std::vector<Pixel> pixels_;  // every fourth of them first
  std::size_t coarse_ = 0;     // how many those are, or all
  std::size_t used_ = 0;
  std::size_t blocks_ = 0;
  std::vector<double> residuals_;
  std::vector<Row> slopes_;
  std::vector<float> weights_;
  std::vector<Row> pulls_;  // of each block
  double noise_ = 0.0;
  double variance_ = 0.0;
  System seen_ = System::Zero();  // the pixels' normal matrix, lower triangle
  Eigen::LLT<System> solver_;
};

}  // namespace

RefinedCorners refine_by_cells(const ImageView& image, const RefinedCorners& border,
                               const TagLayout& layout, const ToneCurve& tone,
                               const CameraModel& lens) {
  if (border.status != RefineStatus::kDone) return border;
  return WholeTagFit(image, border, layout, tone, lens).run().value_or(border);
}

}  // namespace kinescope
