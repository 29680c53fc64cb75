// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/repeated_frames.h"

#include <algorithm>
#include <set>
#include <span>
#include <string_view>

#include <fmt/format.h>

namespace kinescope {
namespace {

constexpr std::string_view kReason = "its frame repeats the image before";

using Sightings = std::span<const TagObservation>;

// Of the frames that show anything, in their order.
std::vector<Sightings> by_frame(const TagObservations& tags) {
  std::vector<Sightings> out;
  const Sightings all = tags.observations;
  for (std::size_t first = 0, next = 0; first < all.size(); first = next) {
    while (next < all.size() && all[next].frame == all[first].frame) ++next;
    out.push_back(all.subspan(first, next - first));
  }
  return out;
}

bool is_same_image(Sightings one, Sightings other) {
  return std::ranges::equal(one, other, [](const TagObservation& a, const TagObservation& b) {
    return a.id == b.id && a.corners_px == b.corners_px;
  });
}

// Any marker that both show, by more than its noise.
bool has_moved(Sightings one, Sightings other) {
  constexpr double kClear = 5.0;  // standard deviations of a corner
  return std::ranges::any_of(one, [&](const TagObservation& a) {
    const auto b = std::ranges::find(other, a.id, &TagObservation::id);
    return b != other.end() && (a.corners_px.front() - b->corners_px.front()).norm() >
                                   kClear * std::max(a.sigma_px, b->sigma_px);
  });
}

// A still robot looks alike, too: only where the image moves right before and right after.
std::set<int> repeated_frames(const std::vector<Sightings>& frames) {
  std::set<int> out;
  for (std::size_t first = 1, next = 1; first < frames.size(); first = next) {
    while (next < frames.size() && is_same_image(frames[first], frames[next])) ++next;
    if (next - first < 2 || next == frames.size() || !has_moved(frames[first - 1], frames[first]) ||
        !has_moved(frames[first], frames[next]))
      continue;
    for (std::size_t k = first + 1; k < next; ++k) out.insert(frames[k].front().frame);
  }
  return out;
}

}  // namespace

void leave_out_repeated_frames(TagObservations& tags) {
  const std::set<int> repeated = repeated_frames(by_frame(tags));
  const auto is_repeated = [&](const TagObservation& seen) {
    return repeated.contains(seen.frame);
  };
  for (const TagObservation& seen : tags.observations)
    if (is_repeated(seen)) tags.rejected.push_back({seen.frame, seen.id, std::string(kReason)});
  std::erase_if(tags.observations, is_repeated);
}

std::vector<std::string> repeated_frame_words(const TagObservations& tags) {
  std::set<int> frames;
  for (const RejectedTag& tag : tags.rejected)
    if (tag.reason == kReason) frames.insert(tag.frame);
  if (frames.empty()) return {};
  return {fmt::format(
      "{} of the {} frames show the image before once more while the robot moves: left out; record "
      "every frame once, with the stamp of its exposure",
      frames.size(), tags.times_s.size())};
}

}  // namespace kinescope
