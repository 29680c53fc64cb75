// SPDX-License-Identifier: Apache-2.0
#include "app/explain/recording_advice.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include <Eigen/Core>
#include <fmt/format.h>

namespace kinescope {
namespace {

constexpr double kLittleMotion = 0.01;  ///< rad or m; an axis seen over less is hardly determined

/// Grey value between pixels; nothing outside the image.
std::optional<double> grey_between(const ImageView& image, const Eigen::Vector2d& at) {
  const int x = static_cast<int>(std::floor(at.x()));
  const int y = static_cast<int>(std::floor(at.y()));
  if (x < 0 || y < 0 || x + 1 >= image.width || y + 1 >= image.height) return std::nullopt;
  const std::uint8_t* p = image.data + std::ptrdiff_t{y} * image.stride + x;
  const double u = at.x() - x;
  const double v = at.y() - y;
  return (1 - v) * ((1 - u) * p[0] + u * p[1]) +
         v * ((1 - u) * p[image.stride] + u * p[image.stride + 1]);
}

struct EdgeStep {
  double contrast = 0.0;
  double bright = 0.0;
  double blur_px = 0.0;
};

/// The step of grey values across an edge, at its middle: its height, and the sigma of the blur
/// that would give its steepest slope (a blurred step has slope height / (sigma sqrt(2 pi))).
std::optional<EdgeStep> step_across(const ImageView& image, const Eigen::Vector2d& a,
                                    const Eigen::Vector2d& b) {
  constexpr double kSpacingPx = 0.5;
  const Eigen::Vector2d along = b - a;
  const Eigen::Vector2d normal = Eigen::Vector2d(along.y(), -along.x()).normalized();
  const double reach = std::clamp(along.norm() / 10.0, 2.0, 8.0);
  std::vector<double> profile;
  const auto steps = static_cast<int>(std::floor(2.0 * reach / kSpacingPx));
  for (int k = 0; k <= steps; ++k) {
    const auto value = grey_between(image, 0.5 * (a + b) + (k * kSpacingPx - reach) * normal);
    if (!value) return std::nullopt;
    profile.push_back(*value);
  }
  const auto [low, high] = std::ranges::minmax(profile);
  double slope = 0.0;
  for (std::size_t i = 1; i < profile.size(); ++i) {
    slope = std::max(slope, std::abs(profile[i] - profile[i - 1]) / kSpacingPx);
  }
  if (slope <= 0.0) return std::nullopt;
  return EdgeStep{high - low, high, (high - low) / (slope * std::sqrt(2.0 * std::numbers::pi))};
}

}  // namespace

void add_edges(MarkerEdges& out, const ImageView& image, const TagObservation& tag) {
  for (std::size_t i = 0; i < tag.corners_px.size(); ++i) {
    const Eigen::Vector2d& a = tag.corners_px[i];
    const Eigen::Vector2d& b = tag.corners_px[(i + 1) % tag.corners_px.size()];
    out.edges_px.push_back((b - a).norm());
    if (const auto step = step_across(image, a, b)) {
      out.contrasts.push_back(step->contrast);
      out.blurs_px.push_back(step->blur_px);
      out.brights.push_back(step->bright);
    }
  }
}

std::vector<std::string> marker_advice(TagId id, double edge_px, double blur_px, double contrast) {
  std::vector<std::string> out;
  if (edge_px < kSmallMarkerPx) {
    out.push_back(
        fmt::format("tag {} is {:.0f} px wide only: film closer or print it larger ({:.0f} px and "
                    "more)",
                    id.value, edge_px, 1.5 * kSmallMarkerPx));
  }
  if (blur_px > kBlurredPx) {
    out.push_back(fmt::format("tag {} is blurred (sigma {:.1f} px): focus, light, shorter exposure",
                              id.value, blur_px));
  }
  if (contrast > 0.0 && contrast < kLowContrast) {
    out.push_back(
        fmt::format("tag {} has little contrast ({:.0f} of 255): more light", id.value, contrast));
  }
  return out;
}

std::string listed_but_not_seen(TagId id, int frames) {
  return fmt::format("tag {} is listed in tags.yaml but was not seen in the {} frames searched",
                     id.value, frames);
}

bool ChannelSpan::moves() const { return range() > 1e-9 * std::max(1.0, std::abs(upper)); }

// Whole numbers over a wide range are encoder ticks; more than a turn in either direction are
// degrees, or mm.
std::string guess_unit(const ChannelSpan& span) {
  if (span.whole && span.range() > 20.0) return "ticks?";
  constexpr double kMoreThanATurn = 2.5 * std::numbers::pi;
  const double largest = std::max(std::abs(span.lower), std::abs(span.upper));
  if (largest > kMoreThanATurn && largest <= 400.0) return "deg or mm?";
  return "rad or m";
}

std::optional<std::string> channel_advice(const std::string& name, const std::string& unit,
                                          const ChannelSpan& span) {
  if (!span.moves()) {
    return fmt::format(
        "channel '{}' never changes: its joint cannot be found; move it, or leave it out", name);
  }
  if (unit == "rad or m" && span.range() < kLittleMotion) {
    return fmt::format(
        "channel '{}' moves by {:.4f} only: its axis will be uncertain; record it over a larger "
        "range",
        name, span.range());
  }
  return std::nullopt;
}

}  // namespace kinescope
