// SPDX-License-Identifier: Apache-2.0
#include "app/explain/sighting_doubts.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace kinescope {

std::vector<std::string> unlisted_marker_words(const TagObservations& tags) {
  constexpr double kAgainAndAgain = 0.1;  // of the frames; a ghost is seen in one or two
  std::map<TagId, int> seen;
  for (const RejectedTag& tag : tags.rejected) {
    if (tag.reason.find("not listed") != std::string::npos) ++seen[tag.id];
  }
  std::vector<int> ids;
  for (const auto& [id, frames] : seen) {
    if (frames > kAgainAndAgain * static_cast<double>(tags.times_s.size())) ids.push_back(id.value);
  }
  if (ids.empty()) return {};
  const bool one = ids.size() == 1;
  return {
      fmt::format("tag{} {} {} seen but not listed in tags.yaml: left out; add {} or "
                  "default_size if {} on the robot",
                  one ? "" : "s", fmt::join(ids, ", "), one ? "is" : "are",
                  one ? "its size" : "their sizes", one ? "it sits" : "they sit")};
}

std::vector<std::string> uncovered_words(const JointLog& log, const std::vector<double>& times_s) {
  constexpr double kFew = 0.2;  // of the frames: clocks apart by a second leave as many over
  if (log.size() < 2 || times_s.empty()) return {};
  const auto uncovered = std::ranges::count_if(
      times_s, [&](double time_s) { return !interpolate(log, 0, time_s).has_value(); });
  if (static_cast<double>(uncovered) <= kFew * static_cast<double>(times_s.size())) return {};
  return {fmt::format(
      "{}: {} of the {} frames have no reading ({} from {:.3f} to {:.3f} s, the frames from {:.3f} "
      "to {:.3f} s): they do not take part; log as long as the camera records, without gaps",
      log.source, uncovered, times_s.size(), log.time_column, log.times_s.front(),
      log.times_s.back(), times_s.front(), times_s.back())};
}

}  // namespace kinescope
