// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/lost_markers.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include <fmt/format.h>

namespace kinescope {
namespace {

// The largest log likelihood of so many of all, each by one and the same chance.
double log_likelihood(double some, double all) {
  const auto term = [&](double n) { return n > 0.0 ? n * std::log(n / all) : 0.0; };
  return term(some) + term(all - some);
}

// In the order of frames: whether the fit rejected the sighting.
using Rejections = std::map<int, bool>;

std::optional<LostMarker> lost_one(TagId id, const Rejections& sightings,
                                   const std::vector<double>& times_s) {
  const auto all = static_cast<double>(sightings.size());
  double lost = 0.0;
  for (const auto& [frame, is_rejected] : sightings) lost += is_rejected ? 1.0 : 0.0;
  // Of a share more and an instant that was searched for.
  const double price = 3.0 * std::log(std::max(2.0, all));
  double best = 2.0 * log_likelihood(lost, all) + price;
  double before = 0.0, lost_before = 0.0;
  std::optional<LostMarker> out;
  int last_frame = 0;
  for (const auto& [frame, is_rejected] : sightings) {
    const double after = all - before;
    const double score =
        2.0 * (log_likelihood(lost_before, before) + log_likelihood(lost - lost_before, after));
    // The larger part of one side is elsewhere, and the larger part of the other one is not.
    const bool is_lost_from = 2.0 * (lost - lost_before) > after && 2.0 * lost_before < before;
    const bool is_lost_to = 2.0 * lost_before > before && 2.0 * (lost - lost_before) < after;
    if (score > best && (is_lost_from || is_lost_to)) {
      best = score;
      const int at = is_lost_from ? frame : last_frame;
      out = LostMarker{id, is_lost_from, times_s[static_cast<std::size_t>(at)],
                       static_cast<int>(is_lost_from ? after : before)};
    }
    before += 1.0;
    lost_before += is_rejected ? 1.0 : 0.0;
    last_frame = frame;
  }
  return out;
}

}  // namespace

std::vector<LostMarker> lost_markers(const Calibration& calibration) {
  std::map<TagId, Rejections> all;
  for (const SightingResidual& residual : calibration.residuals)
    all[residual.id][residual.frame] = !residual.used;
  std::vector<LostMarker> out;
  for (const auto& [id, sightings] : all)
    if (const auto lost = lost_one(id, sightings, calibration.times_s)) out.push_back(*lost);
  if (2 * out.size() >= all.size()) return {};
  return out;
}

std::string words_of(const LostMarker& lost) {
  return fmt::format(
      "tag_{} is not where the robot carries it {} t = {:.6g} {}(it came off, or was stuck on "
      "anew): its {} sightings there are left out",
      lost.id.value, lost.is_lost_from ? "from" : "up to", lost.at_s,
      lost.is_lost_from ? "on " : "", lost.sightings);
}

}  // namespace kinescope
