// SPDX-License-Identifier: Apache-2.0
#include "app/explain/see_cameras.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "app/explain/declared.h"
#include "app/explain/recording_pieces.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "calib/tracks/several_cameras.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

std::vector<LoneCamera> look_alone(const Recording& recording,
                                   const std::function<SeenAlone(const Recording&)>& see_alone,
                                   std::vector<std::string>& warnings) {
  std::vector<LoneCamera> out;
  std::optional<Error> last;
  for (const RecordedCamera& camera : recording.cameras) {
    LoneCamera lone{of_camera(recording, camera), {}, {}};
    try {
      lone.seen = see_alone(lone.recording);
      lone.tracks =
          pose_tracks_from_tags(lone.seen.observed.tags, lone.seen.camera, recording.markers);
    } catch (const Error& error) {
      // A video that cannot be read is a fault of the recording, not a camera that sees nothing.
      const bool sees_nothing = dynamic_cast<const NothingSeen*>(&error) != nullptr;
      if (error.code() != ExitCode::kUndetermined && !sees_nothing) throw;
      warnings.push_back(fmt::format("camera {} is left out: {}", camera.name, error.what()));
      last = error;
      continue;
    }
    for (const std::string& warning : lone.seen.observed.warnings)
      warnings.push_back(fmt::format("camera {}: {}", camera.name, warning));
    out.push_back(std::move(lone));
  }
  if (out.empty()) throw Error(value_of(last));
  return out;
}

// What a search on one camera alone finds of the robot; nothing where it finds no joint that the
// log drives.
struct AloneWithLog {
  double ahead_s = 0.0;  // log time = own time + ahead
  std::size_t driven = 0;
};

AloneWithLog alone_with_log(const LoneCamera& camera, const SightOptions& options) {
  StructureOptions structure;
  structure.scan_time_offset = options.calibrate.estimate_time_offset;
  structure.units = declared_units(camera.recording);
  try {
    const Structure found = find_structure(camera.tracks, camera.recording.log, structure);
    const auto driven = std::ranges::count_if(
        found.joints, [](const StructureJoint& joint) { return joint.channel.has_value(); });
    return {found.time_offset_s, static_cast<std::size_t>(driven)};
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return {};
  }
}

// The cameras' clocks may be farther apart than the log's from theirs is looked for: common time is
// then that of the camera on whose clock the log drives most joints.
void take_clock_of_log(const std::vector<LoneCamera>& cameras, const SightOptions& options,
                       PlacedCameras& placed) {
  std::size_t best = placed.reference;
  std::size_t most = alone_with_log(cameras[best], options).driven;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (c == placed.reference || !placed.places[c]) continue;
    const std::size_t driven = alone_with_log(cameras[c], options).driven;
    if (driven <= most) continue;
    most = driven;
    best = c;
  }
  const double ahead_s = placed.places[best]->ahead_s;
  for (std::optional<CameraPlace>& place : placed.places)
    if (place) place->ahead_s -= ahead_s;
}

bool far_apart(const PlacedCameras& placed, double by_s) {
  return std::ranges::any_of(placed.places, [&](const std::optional<CameraPlace>& place) {
    return place && std::abs(place->ahead_s) > by_s;
  });
}

// Where the motion of common markers does not tie two clocks, each one's own motion against the
// log may.
PlacedCameras tied_by_log(const std::vector<LoneCamera>& cameras,
                          const std::vector<PoseTracks>& tracks, const Recording& recording,
                          const SightOptions& options, PlaceCamerasOptions place_options,
                          std::vector<std::string>& warnings) {
  for (const LoneCamera& camera : cameras) {
    const AloneWithLog alone = alone_with_log(camera, options);
    place_options.ahead_s.push_back(alone.ahead_s);
    if (alone.driven > 0 || std::ranges::none_of(camera.tracks.tracks, marker_moves)) continue;
    warnings.push_back(fmt::format(
        "camera {}: neither a moving marker that another camera sees nor the joint log shows how "
        "its clock runs; taken to be the log's (let both see a marker on a link)",
        camera.recording.camera_name));
  }
  return place_cameras(tracks, recording.markers, place_options);
}

// What nobody would expect of clocks, in words.
void say_far_clocks(const std::vector<LoneCamera>& cameras, const PlacedCameras& placed,
                    std::vector<std::string>& warnings) {
  const auto common = std::ranges::find_if(
      placed.places, [](const auto& place) { return place && place->ahead_s == 0.0; });
  const auto of = static_cast<std::size_t>(common - placed.places.begin());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const std::optional<CameraPlace>& place = placed.places[c];
    if (!place || std::abs(place->ahead_s) <= PlaceCamerasOptions{}.max_offset_s) continue;
    warnings.push_back(fmt::format(
        "camera {}: its stamps are {:.3f} s {} than camera {}'s, as markers that move show; taken "
        "so (use one clock for all cameras and the log)",
        cameras[c].recording.camera_name, std::abs(place->ahead_s),
        place->ahead_s < 0.0 ? "later" : "earlier", cameras[of].recording.camera_name));
  }
}

PlacedCameras place(const std::vector<LoneCamera>& cameras, const Recording& recording,
                    const SightOptions& options, std::vector<std::string>& warnings) {
  std::vector<PoseTracks> tracks;
  std::vector<double> all_times_s;
  for (const LoneCamera& camera : cameras) {
    tracks.push_back(camera.tracks);
    all_times_s.insert(all_times_s.end(), camera.tracks.times_s.begin(),
                       camera.tracks.times_s.end());
  }
  PlaceCamerasOptions place_options;
  place_options.scan_clocks =
      options.calibrate.estimate_time_offset && !is_of_postures(recording.log, all_times_s);
  PlacedCameras out = place_cameras(tracks, recording.markers, place_options);
  const bool unknown = std::ranges::any_of(
      out.places, [](const auto& place) { return place && !place->clock_known; });
  if (unknown)
    return tied_by_log(cameras, tracks, recording, options, std::move(place_options), warnings);
  if (far_apart(out, StructureOptions{}.max_time_offset_s))
    take_clock_of_log(cameras, options, out);
  say_far_clocks(cameras, out, warnings);
  return out;
}

// The reference camera first, then by name, as the recording lists them.
std::vector<std::size_t> order_of(const PlacedCameras& placed) {
  std::vector<std::size_t> out{placed.reference};
  for (std::size_t c = 0; c < placed.places.size(); ++c)
    if (c != placed.reference && placed.places[c]) out.push_back(c);
  return out;
}

PoseTracks renumbered(PoseTracks tracks, const std::vector<int>& frame_of) {
  for (PoseTrack& track : tracks.tracks)
    for (PoseSample& sample : track.samples)
      sample.frame = frame_of[static_cast<std::size_t>(sample.frame)];
  return tracks;
}

// All observations by the common frames.
TagObservations tags_together(const std::vector<ObservedCamera>& cameras,
                              const CommonFrames& frames) {
  TagObservations out;
  out.times_s = frames.times_s;
  out.width = cameras.front().tags.width;
  out.height = cameras.front().tags.height;
  out.lens_known = cameras.front().tags.lens_known;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const auto common = [&](int frame) {
      return frames.frame_of[c][static_cast<std::size_t>(frame)];
    };
    for (TagObservation tag : cameras[c].tags.observations) {
      tag.frame = common(tag.frame);
      out.observations.push_back(std::move(tag));
    }
    for (RejectedTag tag : cameras[c].tags.rejected) {
      tag.frame = common(tag.frame);
      out.rejected.push_back(std::move(tag));
    }
  }
  std::ranges::stable_sort(out.observations, {}, [](const TagObservation& tag) {
    return std::pair(tag.frame, tag.id.value);
  });
  std::ranges::stable_sort(out.rejected, {}, &RejectedTag::frame);
  return out;
}

ObservedCamera observed_camera(LoneCamera& lone, const CameraPlace& place,
                               const SightOptions& options) {
  ObservedCamera out;
  out.name = lone.recording.camera_name;
  out.model = lone.seen.camera;
  out.estimate_intrinsics = options.estimate_intrinsics || !lone.recording.camera;
  out.tags = std::move(lone.seen.observed.tags);
  out.detected = std::move(lone.seen.observed.detected);
  out.T_reference_camera = place.T_reference_camera;
  out.ahead_s = place.ahead_s;
  return out;
}

// Poses and points by the common frames, each as its own tracker has it.
void add_untagged(const std::vector<LoneCamera>& alone, const std::vector<std::size_t>& order,
                  const CommonFrames& frames, Measurements& out) {
  std::vector<PoseTracks> poses;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const Measurements& own = alone[order[k]].seen.observed.measurements;
    poses.push_back(renumbered(own.poses, frames.frame_of[k]));
    for (PointObservation point : own.points.observations) {
      point.frame = frames.frame_of[k][static_cast<std::size_t>(point.frame)];
      out.points.observations.push_back(std::move(point));
    }
  }
  out.poses = merged(poses, frames.times_s);
  out.points.times_s = frames.times_s;
  std::ranges::stable_sort(out.points.observations, {}, [](const PointObservation& point) {
    return std::pair(point.frame, point.id.value);
  });
}

void turn_gravity(const Recording& recording, const std::vector<ObservedCamera>& cameras,
                  Recording& out) {
  if (!recording.settings.gravity) return;
  const std::string& name = recording.settings.gravity_camera;
  const auto camera = std::ranges::find(cameras, name, &ObservedCamera::name);
  if (camera == cameras.end()) {
    throw undetermined(
        "gravity", fmt::format("it is declared in the frame of camera {}, which is left out", name),
        "declare it in the frame of another camera (gravity_camera)");
  }
  out.settings.gravity = camera->T_reference_camera.rotation * *recording.settings.gravity;
}

}  // namespace

SeenTogether join_views(std::vector<LoneCamera> alone, const PlacedCameras& placed,
                        const SightOptions& options) {
  SeenTogether out;
  const std::vector<std::size_t> order = order_of(placed);
  out.recording = alone[placed.reference].recording;
  std::vector<std::vector<double>> times_s;
  for (const std::size_t c : order) {
    std::vector<double>& own = times_s.emplace_back(alone[c].seen.observed.measurements.times_s);
    for (double& t : own) t += placed.places[c]->ahead_s;
  }
  const CommonFrames frames = merge_frames(times_s);
  std::vector<PoseTracks> tracks;
  for (std::size_t k = 0; k < order.size(); ++k) {
    LoneCamera& lone = alone[order[k]];
    const CameraPlace& at = *placed.places[order[k]];
    tracks.push_back(
        moved(renumbered(std::move(lone.tracks), frames.frame_of[k]), at.T_reference_camera));
    out.observed.cameras.push_back(observed_camera(lone, at, options));
  }
  out.tracks = merged(tracks, frames.times_s);
  out.camera = out.observed.cameras.front().model;
  out.observed.measurements.times_s = frames.times_s;
  if (!out.observed.cameras.front().tags.observations.empty()) {
    out.observed.tags = tags_together(out.observed.cameras, frames);
    out.observed.measurements.corners = out.observed.tags.observations;
  }
  add_untagged(alone, order, frames, out.observed.measurements);
  out.observed.measurements.camera_of_frame = frames.camera_of_frame;
  return out;
}

SeenTogether see_cameras(const Recording& recording, const SightOptions& options,
                         const std::function<SeenAlone(const Recording&)>& see_alone) {
  SeenTogether out;
  std::vector<LoneCamera> alone = look_alone(recording, see_alone, out.observed.warnings);
  const PlacedCameras placed = place(alone, recording, options, out.observed.warnings);
  for (std::size_t c = 0; c < alone.size(); ++c) {
    if (placed.places[c]) continue;
    out.observed.warnings.push_back(
        fmt::format("camera {} is left out: it shares no marker with the others at the same time "
                    "(put one, best at rest, in view of both)",
                    alone[c].recording.camera_name));
  }
  std::vector<std::string> warnings = std::move(out.observed.warnings);
  out = join_views(std::move(alone), placed, options);
  out.observed.warnings = std::move(warnings);
  turn_gravity(recording, out.observed.cameras, out.recording);
  out.recording.settings.video_start_s += placed.places[placed.reference]->ahead_s;
  return out;
}

PoseTracks tracks_of_cameras(const TagObservations& tags, const Calibration& calibration,
                             const MarkerSet& markers) {
  std::vector<PoseTracks> all;
  for (std::size_t c = 0; c < calibration.cameras(); ++c) {
    TagObservations own = tags;
    std::erase_if(own.observations,
                  [&](const TagObservation& tag) { return calibration.camera_at(tag.frame) != c; });
    all.push_back(moved(pose_tracks_from_tags(own, calibration.model_of_camera(c), markers),
                        calibration.T_camera_base * calibration.T_camera_base_of(c).inverse()));
  }
  return merged(all, tags.times_s);
}

}  // namespace kinescope
