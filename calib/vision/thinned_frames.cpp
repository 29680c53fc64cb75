// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/thinned_frames.h"

#include <algorithm>
#include <array>
#include <vector>

namespace kinescope {
namespace {

constexpr int kLeftOut = -1;

// The new number of each frame.
std::vector<int> numbered_anew(const TagObservations& tags, int k) {
  std::vector<bool> shows_one(tags.times_s.size());
  for (const TagObservation& seen : tags.observations)
    shows_one[static_cast<std::size_t>(seen.frame)] = true;
  std::array<int, 2> rank = {0, 0};  // among those without and those with a marker
  int kept = 0;
  std::vector<int> out;
  for (const bool shows : shows_one)
    out.push_back(rank[shows ? 1 : 0]++ % k == 0 ? kept++ : kLeftOut);
  return out;
}

// Sightings or rejected ones.
void keep(auto& seen, const std::vector<int>& number) {
  for (auto& one : seen) one.frame = number[static_cast<std::size_t>(one.frame)];
  std::erase_if(seen, [](const auto& one) { return one.frame == kLeftOut; });
}

}  // namespace

std::size_t corners_of(const TagObservations& tags) {
  std::size_t out = 0;
  for (const TagObservation& seen : tags.observations) out += seen.corners_px.size();
  return out;
}

int thinning_of(std::size_t corners, std::size_t most) {
  return static_cast<int>(std::max<std::size_t>(1, (corners + most - 1) / most));
}

TagObservations every_kth_frame(const TagObservations& tags, int k) {
  TagObservations out = tags;
  const std::vector<int> number = numbered_anew(tags, k);
  keep(out.observations, number);
  keep(out.rejected, number);
  std::size_t frame = 0;
  std::erase_if(out.times_s, [&](double) { return number[frame++] == kLeftOut; });
  return out;
}

}  // namespace kinescope
