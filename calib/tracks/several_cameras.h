// SPDX-License-Identifier: Apache-2.0
//
// Takes   the pose tracks of several fixed cameras, each in its own frame and on its own clock.
// Gives   where every camera stands and how its clock runs beside the reference camera's; all
//         tracks in the reference camera's frame, frame by frame or at common instants.
// Frames  T_reference_camera maps a camera's coordinates to the reference camera's; m, s.
// Method  markers that two cameras see at the same time are points in both frames: absolute
//         orientation without scale (Kabsch 1976) with Cauchy weights (Holland and Welsch 1977),
//         at the offset of the clocks at which points of moving markers meet best.
// Not here: the estimate that counts; these are starts for the bundle.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "calib/camera/marker_set.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

struct CameraPlace {
  Pose T_reference_camera;
  double ahead_s = 0.0;      ///< time on the reference camera's clock = own time + ahead
  bool clock_known = false;  ///< by moving markers that both saw; else `ahead_s` is as given
};

struct PlaceCamerasOptions {
  bool scan_clocks = true;    ///< false: the clocks agree
  double max_offset_s = 2.0;  ///< half width of the scan, about `ahead_s`
  /// Of offsets that are believed only where points meet several times as well as at any within
  /// `max_offset_s`; at most half of what both saw is given up.
  double max_far_offset_s = 30.0;
  std::vector<double> ahead_s{};  ///< per camera, own time to a common clock; empty: 0
};

struct PlacedCameras {
  std::size_t reference = 0;  ///< the camera with the most sightings
  /// Of every camera; none: it shares no marker with those that are placed.
  std::vector<std::optional<CameraPlace>> places;
};

/// Cost O(cameras^2 * sightings + offsets * common sightings).
[[nodiscard]] PlacedCameras place_cameras(const std::vector<PoseTracks>& tracks,
                                          const MarkerSet& markers,
                                          const PlaceCamerasOptions& options = {});

/// The marker's origin goes farther than its noise.
[[nodiscard]] bool marker_moves(const PoseTrack& track);

/// The frames of several cameras as one sequence in the order of time, then of the camera.
struct CommonFrames {
  std::vector<double> times_s;
  std::vector<int> camera_of_frame;
  std::vector<std::vector<int>> frame_of;  ///< of every camera: from its own frames to these
};

/// `times_s`: of every camera, on one clock.
[[nodiscard]] CommonFrames merge_frames(const std::vector<std::vector<double>>& times_s);

/// One camera's tracks (frames of any numbering) in the reference camera's frame.
[[nodiscard]] PoseTracks moved(PoseTracks tracks, const Pose& T_reference_camera);

/// The tracks of all cameras as one: those of a marker together, by frame. Frames are numbered in
/// `times_s` alike.
[[nodiscard]] PoseTracks merged(const std::vector<PoseTracks>& tracks, std::vector<double> times_s);

/// What a search over simultaneous sightings needs: the frames of camera 0 only, with what other
/// cameras saw of markers interpolated to their times. A marker's track is that of the camera that
/// saw it most; others fill its gaps. `tracks` in one frame; no camera_of_frame: they are returned.
[[nodiscard]] PoseTracks at_common_instants(const PoseTracks& tracks,
                                            const std::vector<int>& camera_of_frame);

/// Frames of camera 0, in order: the rows of what at_common_instants() gives.
[[nodiscard]] std::vector<int> frames_of_reference(const std::vector<int>& camera_of_frame);

}  // namespace kinescope
