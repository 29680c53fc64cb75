// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibrated robot.
// Gives   markers that are where it carries them up to an instant, or from one on, and elsewhere in
//         the rest of the recording: they came off, or were stuck on anew.
// Method  a change point of the share of sightings that the fit rejected, two shares against one
//         (modified Bayes' criterion, Zhang and Siegmund 2007).
#pragma once

#include <string>
#include <vector>

#include "calib/bundle/calibration.h"

namespace kinescope {

struct LostMarker {
  TagId id;
  bool is_lost_from = true;  ///< that instant on; else up to it
  double at_s = 0.0;         ///< of the first frame, or the last one, in which it is elsewhere
  int sightings = 0;         ///< in which it is

  [[nodiscard]] bool is_lost_at(double time_s) const {
    return is_lost_from ? time_s >= at_s : time_s <= at_s;
  }
};

/// Of one camera. None where most of the markers are lost: then the rest of the model is in doubt.
/// O(sightings log sightings).
[[nodiscard]] std::vector<LostMarker> lost_markers(const Calibration& calibration);

/// For a user.
[[nodiscard]] std::string words_of(const LostMarker& lost);

}  // namespace kinescope
