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
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

using namespace whole_tag;

// Places of the unknowns. Each is a step from what the model has now.
constexpr int kHomography = 0;  // 8: shift, affine and perspective parts, px at the border
constexpr int kBending = 8;     // 4, px
constexpr int kBarrel = 12;     // px
constexpr int kBlur = 13;       // xx, xy, yy, px^2
constexpr int kGamma = 16;
constexpr int kSpread = 17;  // px
constexpr int kPeak = 18;    // px^4
constexpr int kDark = 19;    // 3: in the middle, along x and y
constexpr int kBright = 22;  // 3
constexpr int kBowl = 25;    // 3: x^2, x y, y^2
constexpr int kSize = 28;    // a multiple of 4

constexpr double kReach = 2.5;          // blurs from a step, of pixels that are used
constexpr double kMinOuterWidth = 1.1;  // px around the border that are used at least ..
constexpr double kOuterReach = 2.0;     // .. and at most these blurs less than a cell
constexpr double kTaper = 0.7;          // px over which a weight fades out there
constexpr int kMinPixels = 4 * kSize;
constexpr int kBlock = 8;  // px, of the usual video codecs

// What is known beforehand, standard deviations.
constexpr double kKnownCurvatureSigma = 1e-5;  // 1/px: what a declared lens leaves
constexpr double kCurvatureSigma = 2e-4;       // 1/px: what lenses bend lines by ..
constexpr double kCurvatureScale = 400.0;      // px over which that changes by its own size ..
constexpr double kOddBending = 0.07;  // .. and the share that is not even about the lens' axis
constexpr double kBlurMean = 0.64;    // px^2
constexpr double kBlurSigma = 1.0;    // px^2
constexpr double kGammaSigma = 0.8;
constexpr double kKnownGammaSigma = 0.1;
constexpr double kSpreadSigma = 0.03;  // px: ink, where the tone curve is not
constexpr double kPeakSigma = 0.5;     // px^4: motion flattens a blur, sharpening peaks it
constexpr double kBowlSigma = 0.1;     // of the contrast

constexpr double kLeastBlur = 0.0625;  // px^2, below the pixel's own 1/12
constexpr double kLeastGamma = 0.4;
constexpr double kMostGamma = 4.0;
constexpr double kMostPeak = 2.0;  // px^4
constexpr double kRobust = 3.0;    // noise units beyond which a pixel's weight falls
constexpr double kMinNoise = 0.3;  // grey levels, rounding
constexpr double kMinContrast = 12.0;
constexpr int kMostRounds = 5;
constexpr double kMostMove = 0.5;   // cells; beyond, it is another code
constexpr double kMostNoise = 1.6;  // of the border's: compressed pictures stay below 1.4, a shadow
                                    // across the marker or a cover is beyond 3
constexpr double kFloorSigma = 0.002;  // px, measured: tests/experiments/corners.cpp
// A step below all of these changes the slopes too little to compute them anew.
constexpr double kSmallMove = 0.05;  // px
constexpr double kSmallBlur = 0.06;  // px^2
constexpr double kSmallGamma = 0.15;
constexpr double kSmallPeak = 0.3;

using Row = Eigen::Matrix<float, kSize, 1>;
using System = Eigen::Matrix<double, kSize, kSize>;
using Step = Eigen::Matrix<double, kSize, 1>;

// The tone curve between a dark and a bright level, both 0 to 1, from a table: sharpened pictures
// go a little beyond.
class Tone {
 public:
  Tone(double dark, double bright, double gamma) {
    const double black = std::max(1.0, dark) / kWhite;
    const double white = std::max(black + kMinContrast / kWhite, bright / kWhite);
    const double low = std::pow(black, gamma);
    const double high = std::pow(white, gamma);
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const double share = static_cast<double>(i) / kPerUnit - kBeyond;
      const double light = std::max(kDarkest * low, low + (high - low) * share);
      const double grey = std::pow(light, 1.0 / gamma);
      // By gamma, at the same levels.
      const double low_slope = low * std::log(black);
      const double light_slope = low_slope + (high * std::log(white) - low_slope) * share;
      entries_[i].value = (grey - black) / (white - black);
      entries_[i].per_gamma =
          grey * (light_slope / light - std::log(light) / gamma) / gamma / (white - black);
    }
  }

  struct Value {
    double value = 0.0;
    double slope = 0.0;
    double per_gamma = 0.0;
  };
  [[nodiscard]] Value at(double share) const {
    const double place = (share + kBeyond) * kPerUnit;
    const auto i = static_cast<std::size_t>(
        std::clamp(place, 0.0, static_cast<double>(entries_.size()) - 2.0));
    const double part = place - static_cast<double>(i);
    const Entry& a = entries_[i];
    const Entry& b = entries_[i + 1];
    return {a.value + part * (b.value - a.value), (b.value - a.value) * kPerUnit,
            a.per_gamma + part * (b.per_gamma - a.per_gamma)};
  }

 private:
  static constexpr double kWhite = 255.0;
  static constexpr double kPerUnit = 64.0;
  static constexpr double kBeyond = 0.25;
  static constexpr double kDarkest = 0.2;  // of the dark cells' light
  struct Entry {
    double value = 0.0;
    double per_gamma = 0.0;
  };
  std::array<Entry, 97> entries_;  // -0.25 .. 1.25
};

// What a lens bends of a marker, but for what a homography can do: second order, v = |p|^2 c with p
// from the marker's middle and any c, and what is not of that form; third order, v = q |p|^2 p.
class Bending {
 public:
  Bending() = default;
  Bending(const Eigen::Matrix3d& H, double side) {
    Eigen::Matrix2d J;
    for (int k = 0; k < 2; ++k)
      J.col(k) = (H.col(k).head<2>() - H(2, k) * H.col(2).head<2>() / H(2, 2)) / H(2, 2);
    const Eigen::Matrix2d inverse = J.inverse();
    const double a = J.col(0).squaredNorm();
    const double b = J.col(0).dot(J.col(1));
    const double d = J.col(1).squaredNorm();
    // As multiples of (x^2 - 1, y^2 - 1) along x, and the same along y; an unknown is the sagitta
    // of a side. x y along x is a homography and -y^2 along y.
    Eigen::Matrix<double, 4, 2> even;
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d e = 2.0 / side * inverse.col(k);
      even.col(k) << e.x() * a - 2.0 * b * e.y(), e.x() * d, e.y() * a, e.y() * d - 2.0 * b * e.x();
    }
    const Eigen::HouseholderQR<Eigen::Matrix<double, 4, 2>> qr(even);
    const Eigen::Matrix4d Q = qr.householderQ();
    second_ << even, Q.rightCols<2>() * std::sqrt(0.5) * even.norm();
    third_ = 8.0 / (side * side) * Eigen::Vector3d(a, 2.0 * b, d);
  }

  /// Columns: what each unknown moves, as x and y in px over the side.
  [[nodiscard]] Eigen::Matrix<double, 2, 5> at(double x, double y) const {
    const double xx = x * x - 1.0;
    const double yy = y * y - 1.0;
    Eigen::Matrix<double, 2, 5> out;
    out.topLeftCorner<1, 4>() = xx * second_.row(0) + yy * second_.row(1);
    out.bottomLeftCorner<1, 4>() = xx * second_.row(2) + yy * second_.row(3);
    const double form = third_(0) * xx + third_(1) * x * y + third_(2) * yy;
    out.col(4) << form * x - third_(1) * y, form * y - third_(1) * x;
    return out;
  }

 private:
  Eigen::Matrix4d second_ = Eigen::Matrix4d::Zero();
  Eigen::Vector3d third_ = Eigen::Vector3d::Zero();
};

struct Pixel {
  double x = 0.0;
  double y = 0.0;
  double grey = 0.0;
  double weight = 0.0;
  int block = 0;
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

// Where pixels near a marker would be without the lens's distortion: cubic between the nodes of a
// grid.
class Straight {
 public:
  // Nothing where the lens cannot be undone.
  static std::optional<Straight> over(const CameraModel& lens, const Eigen::AlignedBox2d& box) {
    Straight out;
    out.low_ = box.min();
    out.step_ = box.sizes() / (kNodes - 1);
    for (std::size_t i = 0; i < kNodes; ++i) {
      for (std::size_t j = 0; j < kNodes; ++j) {
        const Eigen::Vector2d px =
            out.low_ +
            Eigen::Vector2d(static_cast<double>(i), static_cast<double>(j)).cwiseProduct(out.step_);
        const auto ray = unproject(lens, px);
        if (!ray) return std::nullopt;
        out.node_[i][j] = {lens.fx * ray->x() + lens.cx, lens.fy * ray->y() + lens.cy};
      }
    }
    return out;
  }

  [[nodiscard]] Eigen::Vector2d at(const Eigen::Vector2d& px) const {
    const Eigen::Vector2d place = (px - low_).cwiseQuotient(step_);
    const auto x = weights(place.x());
    const auto y = weights(place.y());
    Eigen::Vector2d out = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < kNodes; ++i) {
      for (std::size_t j = 0; j < kNodes; ++j) out += x[i] * y[j] * node_[i][j];
    }
    return out;
  }

 private:
  static constexpr std::size_t kNodes = 4;

  // Lagrange's, at nodes 0 to 3.
  static std::array<double, kNodes> weights(double t) {
    return {-(t - 1.0) * (t - 2.0) * (t - 3.0) / 6.0, t * (t - 2.0) * (t - 3.0) / 2.0,
            -t * (t - 1.0) * (t - 3.0) / 2.0, t * (t - 1.0) * (t - 2.0) / 6.0};
  }

  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d step_ = Eigen::Vector2d::Zero();
  std::array<std::array<Eigen::Vector2d, kNodes>, kNodes> node_;
};

// The inverse.
std::optional<Eigen::Vector2d> as_seen(const CameraModel& lens, const Eigen::Vector2d& straight) {
  return project(lens,
                 {(straight.x() - lens.cx) / lens.fx, (straight.y() - lens.cy) / lens.fy, 1.0});
}

class Fit {
 public:
  Fit(const ImageView& image, const RefinedCorners& border, const TagLayout& layout,
      const ToneCurve& tone, const CameraModel* lens)
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
    bool small = false;
    for (int round = 0; !small && round < kMostRounds; ++round) {
      compare(true);
      const std::optional<Step> step = solve(true);
      if (!step) return std::nullopt;
      take(*step);
      small = is_small(*step);
    }
    // Once more with the slopes as they are.
    compare(false);
    const std::optional<Step> step = solve(false);
    if (!small || !step) return std::nullopt;
    take(*step);
    for (std::size_t i = 0; i < residuals_.size(); ++i)
      residuals_[i] -= static_cast<double>(slopes_[i].dot(step->cast<float>()));
    if (!weigh()) return std::nullopt;
    return judged();
  }

 private:
  bool begin() {
    const Corners& seen_corners = border_.corners_px;
    const std::optional<Eigen::Matrix3d> seen_H = corner_fit::tag_to_image(seen_corners);
    if (!seen_H) return false;
    Corners corners = seen_corners;
    if (lens_ != nullptr) {
      straight_ = Straight::over(*lens_, box_of(corners));
      if (!straight_) return false;
      for (Eigen::Vector2d& corner : corners) corner = straight_->at(corner);
    }
    const std::optional<Eigen::Matrix3d> H = corner_fit::tag_to_image(corners);
    if (!H) return false;
    H_ = *H;
    inverse_ = H_.inverse();
    for (std::size_t e = 0; e < 4; ++e) side_ += 0.25 * (corners[(e + 1) % 4] - corners[e]).norm();
    blur_ = std::max(kLeastBlur, border_.blur_px * border_.blur_px) * Eigen::Matrix2d::Identity();
    const Eigen::Vector2d middle = H_.col(2).hnormalized();
    const LocalBlur blur = local_blur(place(middle.x(), middle.y()).on_tag, blur_);
    if (!(std::max(blur.x, blur.y) < kMostBlur)) return false;
    const std::optional<SeenCode> seen = read_code(image_, *seen_H, layout_, {blur.x, blur.y});
    if (!seen || !(seen->bright - seen->dark > kMinContrast)) return false;
    code_ = seen->code;
    dark_(0) = seen->dark;
    bright_(0) = seen->bright;
    bending_ = Bending(H_, side_);
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
    const Eigen::AlignedBox2d box = box_of(border_.corners_px);
    const Eigen::Vector2d& low = box.min();
    const Eigen::Vector2d& high = box.max();
    const double margin = std::max(kMinOuterWidth, kReach * std::sqrt(blur_(0, 0))) + 1.0;
    if (!(low.minCoeff() > margin) || !(high.x() < image_.width - 1 - margin) ||
        !(high.y() < image_.height - 1 - margin))
      return false;
    const int x0 = static_cast<int>(low.x() - margin);
    const int x1 = static_cast<int>(high.x() + margin);
    const int y0 = static_cast<int>(low.y() - margin);
    const int y1 = static_cast<int>(high.y() + margin);
    const int block_columns = x1 / kBlock - x0 / kBlock + 1;
    blocks_ = static_cast<std::size_t>(block_columns * (y1 / kBlock - y0 / kBlock + 1));
    std::size_t unclear = 0;
    for (int y = y0; y <= y1; ++y) {
      const std::uint8_t* row = image_.data + static_cast<std::ptrdiff_t>(image_.stride) * y;
      const int block_row = (y / kBlock - y0 / kBlock) * block_columns;
      for (int x = x0; x <= x1; ++x) {
        Eigen::Vector2d at(x, y);
        if (straight_) at = straight_->at(at);
        const auto [weight, is_clear] = weight_at(place(at.x(), at.y()).on_tag);
        if (!is_clear) ++unclear;
        if (!(weight > 0.0)) continue;
        pixels_.push_back({at.x(), at.y(), static_cast<double>(row[x]), weight,
                           block_row + x / kBlock - x0 / kBlock});
      }
    }
    return pixels_.size() > static_cast<std::size_t>(kMinPixels) && unclear < pixels_.size();
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
      const double off = place - std::round(place);
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

  // Residuals of all pixels, and slopes.
  void compare(bool with_slopes) {
    inverse_ = H_.inverse();
    const Tone tone(dark_(0), bright_(0), gamma_);
    residuals_.resize(pixels_.size());
    slopes_.resize(pixels_.size());
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      const Pixel& pixel = pixels_[i];
      Place p = place(pixel.x, pixel.y);
      const double per_px = layout_.cells / side_;
      const Eigen::Matrix<double, 2, 5> bend = bending_.at(p.x, p.y);
      const Eigen::Vector2d moved = per_px * (bend * bent_);
      p.on_tag.x += moved.x();
      p.on_tag.y += moved.y();
      const Share share = bright_share(code_, p.on_tag, blur_);
      const Tone::Value t = tone.at(share.value + spread_ * share.spread + peak_ * share.peak);
      const double bowl = bowl_(0) * p.x * p.x + bowl_(1) * p.x * p.y + bowl_(2) * p.y * p.y;
      const double ratio = dark_(0) / bright_(0);
      const double dark = dark_(0) + dark_(1) * p.x + dark_(2) * p.y + ratio * bowl;
      const double contrast = bright_(0) + bright_(1) * p.x + bright_(2) * p.y + bowl - dark;
      residuals_[i] = pixel.grey - dark - contrast * t.value;
      if (!with_slopes) continue;
      const double w = contrast * t.slope;
      const double x = w * per_px * share.x;
      const double y = w * per_px * share.y;
      const double pull = x * p.x + y * p.y;
      const double off = 1.0 - t.value;
      const double both = t.value + off * ratio;
      Step s;
      s << x, x * p.x, x * p.y, y, y * p.x, y * p.y, pull * p.x, pull * p.y,
          (bend.transpose() * Eigen::Vector2d(x, y)), w * share.blur, contrast * t.per_gamma,
          w * share.spread, w * share.peak, off, off * p.x, off * p.y, t.value, t.value * p.x,
          t.value * p.y, both * p.x * p.x, both * p.x * p.y, both * p.y * p.y;
      slopes_[i] = s.cast<float>();
    }
  }

  std::optional<Step> solve(bool with_slopes) {
    if (with_slopes) {
      std::vector<double> size;
      size.reserve(residuals_.size());
      for (const double r : residuals_) size.push_back(std::abs(r));
      noise_ = std::max(kMinNoise, 1.4826 * median_of(std::move(size)));
    }
    if (!weigh()) return std::nullopt;
    Row pull = Row::Zero();
    for (const Row& block : pulls_) pull += block;
    Step g = pull.cast<double>();
    if (with_slopes) {
      seen_ = System::Zero();
      add_products(slopes_.data(), weights_.data(), pixels_.size(), seen_);
    }
    const Step believed = variance_ * beliefs();
    solver_.compute(seen_ + System(believed.asDiagonal()));
    if (solver_.info() != Eigen::Success) return std::nullopt;
    g += believed.cwiseProduct(likely() - values());
    Step step = solver_.solve(g);
    const double longest = step.segment<8>(kHomography).cwiseAbs().maxCoeff();
    if (!(longest < kMostMove * side_ / layout_.cells)) return std::nullopt;
    return step;
  }

  // Robust weights of the residuals, their variance, and how they pull.
  bool weigh() {
    pulls_.assign(blocks_, Row::Zero());
    weights_.resize(pixels_.size());
    double cost = 0.0;
    double weight = 0.0;
    const double limit = kRobust * noise_;
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      const double r = residuals_[i];
      const double w = pixels_[i].weight * (std::abs(r) > limit ? limit / std::abs(r) : 1.0);
      weights_[i] = static_cast<float>(w);
      pulls_[static_cast<std::size_t>(pixels_[i].block)] += static_cast<float>(w * r) * slopes_[i];
      cost += w * r * r;
      weight += w;
    }
    if (!(weight > 2.0 * kSize)) return false;
    variance_ = std::max(cost / (weight - kSize), kMinNoise * kMinNoise);
    return true;
  }

  // The unknowns about which something is known beforehand, the others being zero.
  [[nodiscard]] Step values() const {
    Step out = Step::Zero();
    out.segment<5>(kBending) = bent_;
    out.segment<3>(kBlur) << blur_(0, 0), blur_(0, 1), blur_(1, 1);
    out(kGamma) = gamma_;
    out(kSpread) = spread_;
    out(kPeak) = peak_;
    out.segment<3>(kBowl) = bowl_;
    return out;
  }

  [[nodiscard]] Step likely() const {
    Step out = Step::Zero();
    out(kBlur) = out(kBlur + 2) = kBlurMean;
    out(kGamma) = likely_gamma_;
    return out;
  }

  // 1 / sigma^2.
  [[nodiscard]] Step beliefs() const {
    Step sigma = Step::Zero();
    const double sagitta =
        (lens_ == nullptr ? kCurvatureSigma : kKnownCurvatureSigma) * side_ * side_ / 8.0;
    sigma.segment<2>(kBending).setConstant(sagitta);
    sigma.segment<2>(kBending + 2).setConstant(kOddBending * sagitta);
    sigma(kBarrel) = sagitta * side_ / (4.0 * kCurvatureScale);
    sigma.segment<3>(kBlur).setConstant(kBlurSigma);
    sigma(kGamma) = gamma_sigma_;
    sigma(kSpread) = kSpreadSigma;
    sigma(kPeak) = kPeakSigma;
    sigma.segment<3>(kBowl).setConstant(kBowlSigma * (bright_(0) - dark_(0)));
    Step out = Step::Zero();
    for (int i = 0; i < kSize; ++i) out(i) = sigma(i) > 0.0 ? 1.0 / (sigma(i) * sigma(i)) : 0.0;
    return out;
  }

  void take(const Step& d) {
    const double s = 2.0 / side_;
    Eigen::Matrix3d G;  // the square as it is seen to the one that fits
    G << 1.0 + s * d(1), s * d(2), s * d(0), s * d(4), 1.0 + s * d(5), s * d(3), -s * d(6),
        -s * d(7), 1.0;
    H_ = H_ * G.inverse();
    bent_ += d.segment<5>(kBending);
    blur_(0, 0) += d(kBlur);
    blur_(0, 1) += d(kBlur + 1);
    blur_(1, 1) += d(kBlur + 2);
    blur_(1, 0) = blur_(0, 1);
    keep_blur();
    gamma_ = std::clamp(gamma_ + d(kGamma), kLeastGamma, kMostGamma);
    spread_ += d(kSpread);
    peak_ = std::clamp(peak_ + d(kPeak), -kMostPeak, kMostPeak);
    dark_ += d.segment<3>(kDark);
    bright_ += d.segment<3>(kBright);
    bright_(0) = std::max(bright_(0), dark_(0) + kMinContrast);
    bowl_ += d.segment<3>(kBowl);
  }

  static bool is_small(const Step& d) {
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
      out.corners_px[c] = (H_ * corner_fit::kSquare[c].homogeneous()).hnormalized();
      if (lens_ != nullptr) {
        const auto corner = as_seen(*lens_, out.corners_px[c]);
        if (!corner) return std::nullopt;
        out.corners_px[c] = *corner;
      }
      const double moved = (out.corners_px[c] - border_.corners_px[c]).norm();
      if (!(moved < kMostMove * side_ / layout_.cells)) return std::nullopt;
    }
    out.by_cells = true;
    out.noise = noise;
    out.sigma_px = std::hypot(predicted_sigma(), kFloorSigma);
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
  const CameraModel* lens_;
  std::optional<Straight> straight_;  // without a lens none
  double gamma_sigma_;
  double likely_gamma_;
  // The model.
  Eigen::Matrix3d H_ = Eigen::Matrix3d::Identity();  // square to px
  Eigen::Matrix3d inverse_ = Eigen::Matrix3d::Identity();
  double side_ = 0.0;  // px
  Bending bending_;
  Eigen::Matrix<double, 5, 1> bent_ = Eigen::Matrix<double, 5, 1>::Zero();
  Eigen::Matrix2d blur_ = Eigen::Matrix2d::Identity();
  double gamma_;
  double spread_ = 0.0;
  double peak_ = 0.0;
  Eigen::Vector3d dark_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d bright_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d bowl_ = Eigen::Vector3d::Zero();
  TagCode code_;
  // The pixels, and how they compare.
  std::vector<Pixel> pixels_;
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
                               const CameraModel* lens) {
  if (border.status != RefineStatus::kDone) return border;
  return Fit(image, border, layout, tone, lens).run().value_or(border);
}

}  // namespace kinescope
