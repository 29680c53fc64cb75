// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tag_windows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "calib/vision/sightings.h"

namespace kinescope {
namespace {

// What a detector needs around a marker: its white margin, and what turns of it may reach.
constexpr double kMarginOfEdge = 0.6;
constexpr double kMargin = 8.0;  // px
constexpr int kSmallest = 16;    // px
// Grey levels at which brightness is cut off.
constexpr std::array<int, 1> kNoCeiling = {255};
constexpr std::array<int, 2> kCeilings = {150, 90};
// Of the motion from frame to frame, what it may change by until the next one.
constexpr double kChangeOfMotion = 0.5;

GreyImage cut(const ImageView& image, const TagWindow& window, int ceiling) {
  GreyImage part{window.x1 - window.x0 + 1, window.y1 - window.y0 + 1, {}};
  part.pixels.reserve(static_cast<std::size_t>(part.width) * static_cast<std::size_t>(part.height));
  for (int y = window.y0; y <= window.y1; ++y) {
    const std::uint8_t* row = image.data + static_cast<std::ptrdiff_t>(image.stride) * y;
    for (int x = window.x0; x <= window.x1; ++x) {
      part.pixels.push_back(static_cast<std::uint8_t>(std::min<int>(row[x], ceiling)));
    }
  }
  return part;
}

}  // namespace

std::optional<TagWindow> window_around(TagId id, const std::vector<Eigen::Vector2d>& corners_px,
                                       double reach, int width, int height) {
  const double edge = mean_edge_px(corners_px);
  reach += kMarginOfEdge * edge + kMargin;
  Eigen::Vector2d low = corners_px[0];
  Eigen::Vector2d high = corners_px[0];
  for (const Eigen::Vector2d& corner : corners_px) {
    low = low.cwiseMin(corner);
    high = high.cwiseMax(corner);
  }
  const auto pixel = [](double value, int most) {
    return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(most)));
  };
  const TagWindow window{id,
                         pixel(low.x() - reach, width - 1),
                         pixel(low.y() - reach, height - 1),
                         pixel(high.x() + reach, width - 1),
                         pixel(high.y() + reach, height - 1),
                         edge};
  if (window.x1 - window.x0 < kSmallest || window.y1 - window.y0 < kSmallest) return std::nullopt;
  return window;
}

TagPrediction predict_tag(const TagObservation& last,
                          const std::vector<TagObservation>& before_last) {
  TagPrediction out{last.corners_px, 0.0, false};
  const auto before = std::ranges::find(before_last, last.id, &TagObservation::id);
  if (before == before_last.end()) return out;
  for (std::size_t c = 0; c < out.corners_px.size(); ++c)
    out.corners_px[c] += last.corners_px[c] - before->corners_px[c];
  out.reach = kChangeOfMotion * corner_distance_px(last.corners_px, before->corners_px);
  out.motion_known = true;
  return out;
}

std::vector<TagObservation> search_windows(TagDetector& detector, const ImageView& image,
                                           const std::vector<TagWindow>& windows,
                                           Brightness brightness) {
  const std::span<const int> ceilings =
      brightness == Brightness::kCutOff ? std::span<const int>(kCeilings) : kNoCeiling;
  std::vector<TagObservation> out;
  for (const TagWindow& window : windows) {
    for (const int ceiling : ceilings) {
      const GreyImage part = cut(image, window, ceiling);
      std::vector<TagObservation> found = detector.detect(part.view());
      std::erase_if(found, [&](const TagObservation& tag) { return tag.id != window.id; });
      for (TagObservation& tag : found) {
        for (Eigen::Vector2d& corner : tag.corners_px) {
          corner += Eigen::Vector2d(window.x0, window.y0);
        }
        out.push_back(std::move(tag));
      }
      if (!found.empty()) break;
    }
  }
  return out;
}

}  // namespace kinescope
