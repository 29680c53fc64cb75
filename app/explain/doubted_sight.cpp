// SPDX-License-Identifier: Apache-2.0
#include "app/explain/doubted_sight.h"

#include <fmt/format.h>

#include "calib/tracks/camera_from_tags.h"
#include "calib/tracks/shown_shapes.h"
#include "calib/tracks/shown_sizes.h"

namespace kinescope {
namespace {

// What the shapes of the markers' images say, where they say something; the declared one.
std::vector<CameraModel> cameras_to_begin_with(const Recording& recording, const Observed& observed,
                                               const CameraModel& declared) {
  try {
    return {camera_from_tags(observed.tags, recording.markers), declared};
  } catch (const Error&) {
    return {declared};
  }
}

// As the first robot has it that shows with one of these.
std::optional<Sight> with_one_of(const std::vector<CameraModel>& cameras,
                                 const Recording& recording, const Observed& observed,
                                 const CalibrateOptions& options) {
  for (const CameraModel& begin : cameras) {
    const std::optional<CameraModel> found =
        camera_from_motion(recording, observed, begin, options);
    if (!found) continue;
    return Sight{*found,
                 recording.markers,
                 true,
                 {{{"lens_distortion", "camera"}, 0.0},
                  {{"intrinsics", "camera focal length"}, 0.0},
                  {{"intrinsics", "camera centre"}, 0.0}}};
  }
  return std::nullopt;
}

bool is_camera_declared(const Recording& recording, const Observed& observed) {
  return recording.camera && !observed.tags.observations.empty();
}

}  // namespace

std::optional<Sight> with_other_camera(const Recording& recording, const Observed& observed,
                                       const CameraModel& declared,
                                       const CalibrateOptions& options) {
  if (!is_camera_declared(recording, observed)) return std::nullopt;
  return with_one_of(cameras_to_begin_with(recording, observed, declared), recording, observed,
                     options);
}

std::optional<Sight> with_shown_camera(const Recording& recording, const Observed& observed,
                                       const CameraModel& declared,
                                       const CalibrateOptions& options) {
  if (!is_camera_declared(recording, observed)) return std::nullopt;
  const auto cameras = cameras_to_begin_with(recording, observed, declared);
  if (!(log_odds_of_shapes(cameras.front(), declared, observed.tags, recording.markers) > 0.0))
    return std::nullopt;
  return with_one_of(cameras, recording, observed, options);
}

std::optional<Sight> with_other_markers(const Recording& recording, const Observed& observed,
                                        const CameraModel& declared) {
  Sight out{declared, recording.markers, false, {}};
  for (const ShownShape& shown : shown_shapes(declared, observed.tags, recording.markers)) {
    if (!(shown.log_odds > 0.0)) continue;
    std::vector<Eigen::Vector3d>& corners_m = out.markers.boards[shown.id];
    for (const Eigen::Vector3d& corner : recording.markers.corners_m(shown.id))
      corners_m.push_back(shown.shape.corner_m(corner));
    out.told_by.push_back({{"bent_tag", fmt::format("tag_{}", shown.id.value)}, 0.0});
  }
  if (out.told_by.empty()) return std::nullopt;
  return out;
}

std::optional<Sight> with_other_sizes(const Recording& recording, const Observed& observed,
                                      const PoseTracks& tracks, const CameraModel& declared) {
  if (observed.tags.observations.empty()) return std::nullopt;
  Sight out{declared, recording.markers, false, {}};
  for (const ShownSize& shown : shown_sizes(tracks)) {
    if (recording.markers.boards.contains(shown.id)) continue;
    out.markers.sizes_m[shown.id] = shown.factor * recording.markers.size_m(shown.id);
    out.told_by.push_back({{"tag_size", fmt::format("tag_{}", shown.id.value)}, 0.0});
  }
  if (out.told_by.empty()) return std::nullopt;
  return out;
}

}  // namespace kinescope
