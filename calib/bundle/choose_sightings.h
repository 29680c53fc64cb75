// SPDX-License-Identifier: Apache-2.0
//
// Which sightings to trust, and how much, without asking the model: an effect that the model lacks
// must neither lose its evidence as outliers nor pass for noise.
#pragma once

#include <vector>

#include "calib/bundle/problem.h"
#include "calib/bundle/solve.h"

namespace kinescope::bundle {

struct ChosenSightings {
  std::vector<int> used;  ///< those that do not stand out from their neighbours in time
  double bias_px = 0.0;   ///< what corners of markers at rest are off by, all the time
  /// Scatter of the frames' stamps about the joint log's clock, standard deviation; 0 where it does
  /// not show.
  double jitter_s = 0.0;
};

/// Sets the sigmas in `spec` to how much residuals at `state` differ from those of their
/// neighbours (of poses, turns and shifts each by their own); markers at rest count once for all
/// their frames. Where the stamps of the frames jitter, sightings in motion count for less: the
/// faster, the less.
[[nodiscard]] ChosenSightings choose_by_neighbours(Spec& spec, const State& state,
                                                   const std::vector<int>& usable,
                                                   double reject_sigma);

/// What a robust solution used, and what it rejected in a row and not by chance: up to an end of
/// the recording (the marker may have slipped, the camera may have been bumped), or from one value
/// of a joint that carries the marker to another (the joint may err there). Of postures, whose
/// neighbours in time say nothing.
[[nodiscard]] std::vector<int> with_what_lasts(const Spec& spec, const State& state,
                                               const RobustSolution& solution);

}  // namespace kinescope::bundle
