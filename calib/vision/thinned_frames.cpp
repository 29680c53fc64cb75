// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/thinned_frames.h"

namespace kinescope {

int thin_frames(TagObservations& tags, std::size_t most) {
  std::size_t corners = 0;
  for (const TagObservation& seen : tags.observations) corners += seen.corners_px.size();
  const std::size_t every = (corners + most - 1) / most;
  if (every < 2) return 1;
  std::size_t rank = 0;
  int frame = tags.observations.front().frame;
  std::erase_if(tags.observations, [&](const TagObservation& seen) {
    if (seen.frame != frame) ++rank;
    frame = seen.frame;
    return rank % every != 0;
  });
  return static_cast<int>(every);
}

}  // namespace kinescope
