// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/thinned_frames.h"

#include <array>
#include <vector>

namespace kinescope {
namespace {

constexpr int kLeftOut = -1;

std::size_t corners_of(const TagObservations& tags) {
  std::size_t out = 0;
  for (const TagObservation& seen : tags.observations) out += seen.corners_px.size();
  return out;
}

// The new number of each frame.
std::vector<int> numbered_anew(const TagObservations& tags, int every) {
  std::vector<bool> shows_one(tags.times_s.size());
  for (const TagObservation& seen : tags.observations)
    shows_one[static_cast<std::size_t>(seen.frame)] = true;
  std::array<int, 2> rank = {0, 0};  // among those without and those with a marker
  int kept = 0;
  std::vector<int> out;
  for (const bool shows : shows_one)
    out.push_back(rank[shows ? 1 : 0]++ % every == 0 ? kept++ : kLeftOut);
  return out;
}

// Sightings or rejected ones.
void keep(auto& seen, const std::vector<int>& number) {
  for (auto& one : seen) one.frame = number[static_cast<std::size_t>(one.frame)];
  std::erase_if(seen, [](const auto& one) { return one.frame == kLeftOut; });
}

}  // namespace

std::optional<ThinnedFrames> thin_frames(const TagObservations& tags, std::size_t most) {
  const auto every = static_cast<int>((corners_of(tags) + most - 1) / most);
  if (every < 2) return std::nullopt;
  ThinnedFrames out{every, tags};
  const std::vector<int> number = numbered_anew(tags, every);
  keep(out.tags.observations, number);
  keep(out.tags.rejected, number);
  std::size_t frame = 0;
  std::erase_if(out.tags.times_s, [&](double) { return number[frame++] == kLeftOut; });
  return out;
}

}  // namespace kinescope
