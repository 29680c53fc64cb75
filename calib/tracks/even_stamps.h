// SPDX-License-Identifier: Apache-2.0
//
// Takes   the stamps of a camera's frames.
// Gives   the stamps that they would have of a camera that runs evenly: of every frame the period
//         in which it was most likely exposed.
// Units   s.
// Method  the frequency is the highest peak of the stamps' periodogram (a sum of unit phasors, as
// of
//         a point process: Bartlett 1963) near that of their median step; frames that arrive
//         together are of the periods before; where the first one begins is a median.
// Not here: whether the camera did run evenly; what it saw tells.
#pragma once

#include <optional>
#include <vector>

namespace kinescope {

struct EvenStamps {
  std::vector<double> times_s;  ///< strictly increasing
  double rate_hz = 0.0;
  double scatter_s = 0.0;  ///< of the stamps about them, standard deviation
};

/// `times_s`: strictly increasing. Nothing where they are even as they are, too few to tell, or
/// where fewer than half of all periods would have a frame.
[[nodiscard]] std::optional<EvenStamps> even_stamps(const std::vector<double>& times_s);

}  // namespace kinescope
