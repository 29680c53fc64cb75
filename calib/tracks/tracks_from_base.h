// SPDX-License-Identifier: Apache-2.0
//
// Takes   pose tracks in the frame of a camera that moves, and markers that keep their places among
//         one another.
// Gives   where those markers are beside the first of them, where the camera is in every frame that
//         shows one, and all other tracks in the first one's frame.
// Frames  base: the frame of the first of the base markers. Covariances of right perturbations.
// Method  a map from markers seen together, along the pairs seen together most often (maximum
//         spanning tree, Kruskal 1956); a frame's pose by least squares over its base markers,
//         weighted by their covariances (Barfoot 2017, section 7.3.1).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

/// The camera's pose in one frame.
struct CameraPose {
  Pose T_camera_base;
  Matrix6d covariance = Matrix6d::Identity();
};

struct BaseView {
  std::vector<TagId> markers;                      ///< those that could be placed beside the first
  std::vector<Pose> T_base_marker;                 ///< beside `markers`
  std::vector<std::optional<CameraPose>> cameras;  ///< one a frame
  PoseTracks others;  ///< of all other markers, T_base_marker in place of T_camera_marker
};

/// `base`: at least one marker that is seen. A marker that no chain of frames ties to the first is
/// left out, and is in no track.
[[nodiscard]] BaseView tracks_from_base(const PoseTracks& tracks, std::span<const TagId> base);

}  // namespace kinescope
