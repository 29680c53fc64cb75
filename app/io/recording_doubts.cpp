// SPDX-License-Identifier: Apache-2.0
#include "app/io/recording_doubts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include <fmt/format.h>

namespace kinescope {
namespace {

/// Twice the area within the corners, by Gauss' formula: below zero where they go round
/// counter-clockwise in an image whose v counts down.
double doubled_area(const std::vector<Eigen::Vector2d>& corners_px) {
  double sum = 0.0;
  for (std::size_t i = 0; i < corners_px.size(); ++i) {
    const Eigen::Vector2d& a = corners_px[i];
    const Eigen::Vector2d& b = corners_px[(i + 1) % corners_px.size()];
    sum += a.x() * b.y() - b.x() * a.y();
  }
  return sum;
}

}  // namespace

void turn_clockwise_corners(TagObservations& corners, const MarkerSet& markers,
                            const std::filesystem::path& file, std::vector<std::string>& warnings) {
  constexpr double kNearlyAll = 0.95;  // a detector errs in fewer
  struct Sightings {
    std::vector<TagObservation*> clockwise;
    int all = 0;
    [[nodiscard]] bool nearly_all() const {
      return !clockwise.empty() && static_cast<double>(clockwise.size()) >= kNearlyAll * all;
    }
  };
  std::map<TagId, Sightings> by_tag;
  Sightings together;
  for (TagObservation& tag : corners.observations) {
    if (markers.boards.contains(tag.id)) continue;
    const bool is_clockwise = doubled_area(tag.corners_px) > 0.0;
    for (Sightings* of : {&by_tag[tag.id], &together}) {
      ++of->all;
      if (is_clockwise) of->clockwise.push_back(&tag);
    }
  }
  const auto turn = [](const Sightings& of) {
    for (TagObservation* tag : of.clockwise) std::ranges::reverse(tag->corners_px);
  };
  if (together.nearly_all()) {
    turn(together);
    warnings.push_back(fmt::format(
        "{}: the corners 0, 1, 2, 3 of {} of {} sightings go round clockwise: taken for OpenCV's "
        "order, from the upper left. Does v count upward instead, the robot comes out mirrored: "
        "take v from the images' height",
        file.string(), together.clockwise.size(), together.all));
    return;
  }
  std::string names;
  for (const auto& [id, own] : by_tag) {
    if (!own.nearly_all()) continue;
    turn(own);
    names += fmt::format("{}tag_{}", names.empty() ? "" : ", ", id.value);
  }
  if (names.empty()) return;
  warnings.push_back(
      fmt::format("{}: the corners 0, 1, 2, 3 of {} go round clockwise, those of other markers "
                  "do not: taken for OpenCV's order, from the upper left; give all in one order",
                  file.string(), names));
}

void warn_of_principal_point(const CameraModel& camera, const std::filesystem::path& file,
                             std::vector<std::string>& warnings) {
  if (camera.width <= 0 || camera.height <= 0) return;  // its file tells no size
  constexpr double kMiddle = 0.15;  // of the size; lenses sit within a few hundredths
  const auto off = [&](double at, int size) {
    return std::abs(at / static_cast<double>(size) - 0.5) > kMiddle;
  };
  if (!off(camera.cx, camera.width) && !off(camera.cy, camera.height)) return;
  const bool exchanged = !off(camera.cy, camera.width) && !off(camera.cx, camera.height);
  warnings.push_back(fmt::format(
      "{}: the principal point ({:.6g}, {:.6g}) is far from the middle of images of {} x {} px: {}",
      file.string(), camera.cx, camera.cy, camera.width, camera.height,
      exchanged ? "are cx and cy exchanged?"
                : fmt::format("are these the intrinsics of images of {:.0f} x {:.0f} px, or were "
                              "the images cut out of larger ones?",
                              2.0 * camera.cx + 1.0, 2.0 * camera.cy + 1.0)));
}

}  // namespace kinescope
