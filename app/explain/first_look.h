// SPDX-License-Identifier: Apache-2.0
//
// A first structure, before the long search: what it says against the input as a whole.
#pragma once

#include "app/explain/pipeline.h"

namespace kinescope {

/// Throws undetermined, or bad_input, where the markers move as a robot's do, but not with this
/// log (another robot's, another clock), where poses move so only in another convention
/// (quaternions w first, inverse poses), and where no marker moves while the log's channels do. A
/// recording with a nominal robot, and points, are passed over. Gives the structure that it looked
/// at, before a fixed camera: the search is long.
std::optional<Structure> require_plausible_motion(const Recording& recording,
                                                  const PoseTracks& tracks,
                                                  const CalibrateOptions& options);

}  // namespace kinescope
