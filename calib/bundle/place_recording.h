// SPDX-License-Identifier: Apache-2.0
//
// Takes   a robot whose markers are known, joint values and marker poses of another recording of
//         it.
// Gives   where its base stands in that recording's camera frame, and where every marker sits: the
//         start of a calibration of several recordings.
// Method  markers that sit where they did place the base by absolute orientation (Kabsch 1976);
//         where none does, robot-world and hand-eye calibration (place_markers.h). Of the bases
//         that each marker, all of them and the latter propose, the one about which the sightings
//         are most probable, a marker that sits elsewhere paying for its mount (Schwarz 1978).
// Not here: whether a marker that sits elsewhere by a little does so in truth.
#pragma once

#include <optional>
#include <vector>

#include "kinematics/model/kinematic_tree.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

/// A marker in the recording, by what its own sightings say.
struct RecordedMarker {
  Marker marker;
  bool is_known = false;  ///< the robot has one of this id
  /// On the robot's link of that id; another one explains its motion no better.
  bool is_on_its_link = false;
};

struct RecordingPlacement {
  Pose T_camera_base;
  std::vector<RecordedMarker> markers;  ///< by id; those with a joint value in any frame
};

/// `joint_values`: frames x joints (rad, m), NaN where unknown. Throws undetermined when neither a
/// known marker is seen nor one moves enough to place the base.
[[nodiscard]] RecordingPlacement place_recording(const KinematicTree& robot,
                                                 const Eigen::MatrixXd& joint_values,
                                                 const PoseTracks& tracks);

/// The link that carries a marker, and where on it, with the base known; nothing where no frame
/// shows it.
[[nodiscard]] std::optional<Marker> placed_marker(const KinematicTree& robot,
                                                  const Eigen::MatrixXd& joint_values,
                                                  const PoseTrack& track,
                                                  const Pose& T_camera_base);

}  // namespace kinescope
