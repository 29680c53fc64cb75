// SPDX-License-Identifier: Apache-2.0
//
// Takes   evidence.
// Gives   a copy of it without some sightings, with another log, or with other stamps.
// Not here: what speaks for that (contradictions.h, explain.cpp).
#pragma once

#include <functional>
#include <vector>

#include "app/explain/explain.h"

namespace kinescope {

/// Evidence that owns what it changed.
struct ChangedEvidence {
  Recording recording;
  Observed observed;
  PoseTracks tracks;
  CameraModel camera;

  /// Valid as long as this lives.
  [[nodiscard]] Evidence view() const { return {recording, observed, tracks, camera}; }
};

[[nodiscard]] ChangedEvidence with_log(const Evidence& evidence, JointLog log);

/// Without the sightings of which this is true, by marker and frame.
[[nodiscard]] ChangedEvidence without_sightings(const Evidence& evidence, JointLog log,
                                                const std::function<bool(TagId, int)>& is_aside);

/// `times_s`: of every frame.
[[nodiscard]] ChangedEvidence with_stamps(const Evidence& evidence,
                                          const std::vector<double>& times_s);

}  // namespace kinescope
