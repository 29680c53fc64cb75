// SPDX-License-Identifier: Apache-2.0
//
// What is left and is no noise though it follows nothing that is known: several bodies behind a
// joint that differ from their prediction alike, instant by instant (a joint that vibrates,
// readings that tremble). Sensors err in each body by itself.
#pragma once

#include <optional>
#include <vector>

#include "calib/trace/normal_system.h"

namespace kinescope::trace {

struct CommonMotion {
  std::size_t place = 0;       ///< of the rest places
  double size = 0.0;           ///< rms, in the place's unit
  double share = 0.0;          ///< of the squares of what is left in the rows that the place moves
  double largest_share = 0.0;  ///< the same of whichever place has most
};

/// Of places whose motion makes nearly as much of what is left in their rows as any does, the one
/// that explains most of the residual: bodies further out show what a joint before them does, too.
/// Its variance is that of products between different bodies (Linearisation::body), to which errors
/// of one body add nothing. `clock`: the carrier of the time of an instant, whose errors are taken
/// out first; -1: none. Nothing where no place moves two bodies.
[[nodiscard]] std::optional<CommonMotion> find_common_motion(const NormalSystem& system,
                                                             const std::vector<RestPlace>& places,
                                                             int clock);

}  // namespace kinescope::trace
