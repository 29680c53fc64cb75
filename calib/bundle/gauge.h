// SPDX-License-Identifier: Apache-2.0
//
// Takes   a linearised bundle in which every link's frame is free (a nominal robot with a prior).
// Gives   the same bundle in which the choice of frames is held: base frame to the first marker of
//         the base (or to the camera, or to targets), a joint's frame neither turning about its
//         axis nor sliding along it. What remains has a meaning of its own, as without a nominal
//         robot.
// Not here: the choice that a fit without a nominal robot makes from the start (make_spec.h).
#pragma once

#include "calib/bundle/linearise.h"

namespace kinescope::bundle {

/// Derivatives lose the columns that are held. The prior is marginalised over the choice, so that
/// the posterior of what remains is that of the whole bundle: an S-transformation (Baarda 1973;
/// Kanatani and Morris 2001). Where something else already holds a frame (a mount or a joint that
/// is not estimated), nothing more is held.
[[nodiscard]] LinearBundle with_frames_held(const Spec& spec, const State& state,
                                            LinearBundle linear);

}  // namespace kinescope::bundle
