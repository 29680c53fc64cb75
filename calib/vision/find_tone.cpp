// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/find_tone.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>

#include "calib/vision/marker_edges.h"
#include "calib/vision/pattern_shift.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kLeastCell = 4.5;  // px; smaller cells blur into one another
// Ink spreads over what is bright, against a tone curve; this much of it may be missing.
constexpr double kInkSigma_m = 2e-5;
constexpr double kLikelyScatter = 0.03;  // px per px of blur, from marker to marker ..
constexpr double kLikelyMarkers = 2.0;   // .. believed as if seen on so many
constexpr double kClearBloom = 3.0;      // standard deviations
constexpr double kLeastShift = 0.02;     // px; less is not worth a correction
constexpr double kAlike = 0.5;           // by which share border and inner edges may disagree
constexpr double kMostGamma = 3.0;       // of any camera
constexpr double kConverged = 0.005;     // px per px of blur
constexpr int kMostRounds = 6;

// What one view shows in the light of some tone curve, per px of its blur.
struct Shift {
  TagId id;
  double bloom = 0.0;
  double growth = 0.0;
  double ink_per_m = 0.0;  // bloom by ink that takes a m off what is bright
  double blur_px = 0.0;
};

double mean_edge(const Corners& corners) {
  double sum = 0.0;
  for (std::size_t e = 0; e < 4; ++e) sum += 0.25 * (corners[(e + 1) % 4] - corners[e]).norm();
  return sum;
}

std::vector<Shift> measure(std::span<const ToneView> views, const TagLayout& layout,
                           const ToneCurve& tone) {
  std::vector<Shift> out;
  for (const ToneView& view : views) {
    const RefinedCorners refined = refine_border(view.image, view.corners_px, layout, tone);
    if (refined.status != RefineStatus::kDone) continue;
    const double edge = mean_edge(refined.corners_px);
    if (refined.blur_px > corner_fit::kSharp * edge / layout.cells) continue;
    const auto found = pattern_bloom(view.image, refined.corners_px, layout, tone, refined.blur_px);
    if (!found) continue;
    const double ink = view.size_m > 0.0 ? edge / view.size_m / refined.blur_px : 0.0;
    out.push_back({view.id, found->bloom_px / refined.blur_px, found->growth_px / refined.blur_px,
                   ink, refined.blur_px});
  }
  return out;
}

// What the views have in common.
struct Pooled {
  double bloom = 0.0;
  double growth = 0.0;
  double sigma = 0.0;           // of bloom, by the scatter from marker to marker
  double sigma_with_ink = 0.0;  // .. and where ink may have spread
  double blur_px = 0.0;
};

// Views of one marker err alike (its print, its place in the image): each counts once.
std::vector<Shift> by_marker(const std::vector<Shift>& shifts) {
  std::map<TagId, std::vector<Shift>> views;
  for (const Shift& shift : shifts) views[shift.id].push_back(shift);
  std::vector<Shift> out;
  for (const auto& [id, seen] : views) {
    const auto median = [&](double Shift::* value) {
      std::vector<double> values;
      for (const Shift& shift : seen) values.push_back(shift.*value);
      return median_of(std::move(values));
    };
    out.push_back({id, median(&Shift::bloom), median(&Shift::growth), median(&Shift::ink_per_m),
                   median(&Shift::blur_px)});
  }
  return out;
}

std::optional<Pooled> pool(const std::vector<Shift>& shifts) {
  if (shifts.size() < kFewestToneViews) return std::nullopt;
  constexpr int kReweightings = 5;
  const std::vector<Shift> markers = by_marker(shifts);
  const double count = static_cast<double>(markers.size());
  // Bloom by the tone curve, and the spread of ink, m.
  Eigen::Vector2d x = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance;
  double scatter = 0.0;
  Pooled out;
  for (int round = 0; round <= kReweightings; ++round) {
    std::vector<double> off;
    for (const Shift& marker : markers)
      off.push_back(marker.bloom - x(0) - marker.ink_per_m * x(1));
    scatter = std::max(
        kLikelyScatter, kSigmaOverMedian * [&] {
          if (round == 0) return 1.0;  // not yet known: all count alike
          std::vector<double> size;
          for (const double r : off) size.push_back(std::abs(r));
          return median_of(std::move(size));
        }());
    Eigen::Matrix2d H = Eigen::Vector2d(0.0, std::pow(kInkSigma_m, -2)).asDiagonal();
    Eigen::Vector2d g = Eigen::Vector2d::Zero();
    double growth = 0.0;
    double weights = 0.0;
    double square = 0.0;
    for (std::size_t i = 0; i < markers.size(); ++i) {
      constexpr double kHuber = 1.5;
      const double weight = std::min(1.0, kHuber * scatter / std::max(1e-12, std::abs(off[i])));
      const Eigen::Vector2d row(1.0, markers[i].ink_per_m);
      H += weight / (scatter * scatter) * row * row.transpose();
      g += weight / (scatter * scatter) * markers[i].bloom * row;
      growth += weight * (markers[i].growth - markers[i].ink_per_m * x(1));
      weights += weight;
      square += weight * off[i] * off[i];
    }
    covariance = H.inverse();
    x = covariance * g;
    out.growth = growth / weights;
    out.sigma = std::sqrt((kLikelyMarkers * kLikelyScatter * kLikelyScatter + square) /
                          (kLikelyMarkers + count - 1.0) / weights);
  }
  out.bloom = x(0);
  out.sigma_with_ink = std::max(out.sigma, std::sqrt(covariance(0, 0)));
  std::vector<double> blurs;
  for (const Shift& marker : markers) blurs.push_back(marker.blur_px);
  out.blur_px = median_of(std::move(blurs));
  return out;
}

}  // namespace

bool shows_tone(const Corners& corners_px, const TagLayout& layout) {
  return mean_edge(corners_px) > kLeastCell * layout.cells;
}

std::optional<FoundTone> find_tone(std::span<const ToneView> views, const TagLayout& layout) {
  const std::optional<Pooled> grey = pool(measure(views, layout, ToneCurve()));
  if (!grey || grey->bloom < kClearBloom * grey->sigma_with_ink ||
      grey->bloom * grey->blur_px < kLeastShift ||
      std::abs(grey->growth - grey->bloom) > kAlike * grey->bloom) {
    return std::nullopt;
  }
  FoundTone out{ToneCurve(), grey->bloom * grey->blur_px, grey->sigma};
  // The gamma without bloom, by regula falsi between known ones (Illinois).
  double low = 1.0;
  double high = kMostGamma;
  double at_low = grey->bloom;
  const std::optional<Pooled> most = pool(measure(views, layout, ToneCurve(kMostGamma)));
  if (!most || most->bloom > 0.0) return out;
  double at_high = most->bloom;
  for (int round = 0; round < kMostRounds; ++round) {
    const double gamma = (low * at_high - high * at_low) / (at_high - at_low);
    const std::optional<Pooled> found = pool(measure(views, layout, ToneCurve(gamma)));
    if (!found) return out;
    if (std::abs(found->bloom) < kConverged || round + 1 == kMostRounds) {
      out.curve = ToneCurve(gamma);
      out.sigma_per_blur = found->sigma;
      break;
    }
    if (found->bloom > 0.0) {
      low = gamma;
      at_low = found->bloom;
      at_high *= 0.5;
    } else {
      high = gamma;
      at_high = found->bloom;
      at_low *= 0.5;
    }
  }
  return out;
}

}  // namespace kinescope
