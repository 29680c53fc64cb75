// SPDX-License-Identifier: Apache-2.0
//
// What was measured of the robot, in whichever form it was measured.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/camera/tag_observations.h"
#include "kinematics/core/ids.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

/// One row of points.csv: a point on the robot seen by a tracker, or held in a socket.
struct PointObservation {
  int frame = 0;
  TagId id;  ///< the point on the robot
  std::optional<Eigen::Vector3d>
      position_m;         ///< in the tracker's frame; none: unknown but fixed target
  std::string target;     ///< name of the socket when the position is unknown
  double sigma_m = 1e-4;  ///< of one coordinate
};

/// A measured distance between two sockets.
struct TargetDistance {
  std::string from;
  std::string to;
  double distance_m = 0.0;
  double sigma_m = 1e-4;
};

struct PointObservations {
  std::vector<double> times_s;
  std::vector<PointObservation> observations;  ///< by frame, then id
  std::vector<TargetDistance> distances;
};

/// Exactly one of the three is filled; all share the frames' times.
struct Measurements {
  std::vector<double> times_s;
  std::vector<TagObservation> corners;  ///< of a video or corners.csv
  PoseTracks poses;                     ///< of poses.csv
  PointObservations points;             ///< of points.csv
  /// Which camera each frame is of: 0 is the reference camera, on whose clock the frames' times
  /// are. Empty: there is one camera.
  std::vector<int> camera_of_frame = {};
  /// Cameras of recordings of their own, one after the other: what was added to each one's stamps,
  /// s. Empty: all cameras are of one recording.
  std::vector<double> starts_s = {};
};

/// Of markers, bodies and points, over all frames.
[[nodiscard]] inline std::size_t sightings_in(const Measurements& measurements) {
  std::size_t count = measurements.corners.size() + measurements.points.observations.size();
  for (const PoseTrack& track : measurements.poses.tracks) count += track.samples.size();
  return count;
}

}  // namespace kinescope
