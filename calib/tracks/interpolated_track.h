// SPDX-License-Identifier: Apache-2.0
//
// One marker's poses between the frames in which it was seen. Internal to the room.
#pragma once

#include <optional>
#include <vector>

#include "kinematics/structure/pose_tracks.h"

namespace kinescope::tracks {

class InterpolatedTrack {
 public:
  /// Samples in the order of time. `bridge_s`: the longest gap that is interpolated over; 0: only
  /// the times of the samples themselves.
  InterpolatedTrack(std::vector<double> times_s, std::vector<const PoseSample*> samples,
                    double bridge_s);
  /// The sample at a time, linear between its neighbours (rotations along the geodesic), as are
  /// both planar branches where both neighbours have them; `frame` is 0.
  [[nodiscard]] std::optional<PoseSample> at(double time_s) const;

 private:
  std::vector<double> times_s_;
  std::vector<const PoseSample*> samples_;
  double bridge_s_;
};

/// Over gaps of this many of a camera's steps its tracks are interpolated: a frame or two without
/// the marker. Chosen, not measured.
inline constexpr double kBridgedSteps = 3.5;

/// Most of the times are times of the others, too: postures, or cameras on one trigger. Nothing is
/// to be interpolated.
[[nodiscard]] bool are_simultaneous(const std::vector<double>& times_s,
                                    const std::vector<double>& others_s);

}  // namespace kinescope::tracks
