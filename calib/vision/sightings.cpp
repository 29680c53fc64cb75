// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/sightings.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <tuple>

#include <fmt/format.h>

#include "calib/vision/double_ids.h"
#include "calib/vision/tag_detector.h"

namespace kinescope {
namespace {

constexpr double kJumpOfEdge = 0.75;    // a jump is further than this share of the marker's edge ..
constexpr double kJumpOfMotion = 0.75;  // .. and of its motion between the neighbours ..
constexpr double kJumpLeast = 5.0;      // .. and than this many px
constexpr double kMarginRatio =
    1.5;  // decision margins that differ by this tell two detections apart
constexpr double kNearlyAll = 0.9;  // of a marker's sightings

using Sightings = std::vector<TagObservation>;

void reject(TagObservations& all, const TagObservation& tag, std::string reason) {
  all.rejected.push_back({tag.frame, tag.id, std::move(reason)});
}

// Keeps those for which `reason_not` gives nothing.
template <typename Judge>
void keep_if(TagObservations& all, Judge reason_not) {
  Sightings kept;
  for (TagObservation& tag : all.observations) {
    if (std::optional<std::string> reason = reason_not(tag)) {
      reject(all, tag, std::move(*reason));
    } else {
      kept.push_back(std::move(tag));
    }
  }
  all.observations = std::move(kept);
}

std::optional<std::string> undeclared(const TagObservation& tag, const MarkerSet& markers) {
  const bool listed = markers.sizes_m.contains(tag.id);
  if (markers.only_listed && !listed) return "id is not listed";
  if (!(markers.size_m(tag.id) > 0.0)) return "no size is declared for this id";
  return std::nullopt;
}

// Sightings by marker, in the order of their frames.
std::map<TagId, std::vector<const TagObservation*>> by_marker(const Sightings& sightings) {
  std::map<TagId, std::vector<const TagObservation*>> out;
  for (const TagObservation& tag : sightings) out[tag.id].push_back(&tag);
  return out;
}

double allowed_jump(double edge, double motion) {
  return std::max({kJumpOfEdge * edge, kJumpOfMotion * motion, kJumpLeast});
}

// How far a sighting is from where its neighbours in time put it, as a share of what is allowed;
// nothing without neighbours.
std::optional<double> jump(const TagObservation& tag, const TagObservation* before,
                           const TagObservation* after, const std::vector<double>& times) {
  const auto time = [&](const TagObservation& t) {
    return times[static_cast<std::size_t>(t.frame)];
  };
  const double now = time(tag);
  if (before != nullptr && now - time(*before) > kNearby_s) before = nullptr;
  if (after != nullptr && time(*after) - now > kNearby_s) after = nullptr;
  const double edge = mean_edge_px(tag.corners_px);
  if (before != nullptr && after != nullptr) {
    const auto expected = corners_between(*before, time(*before), *after, time(*after), now);
    const double motion = corner_distance_px(before->corners_px, after->corners_px);
    return corner_distance_px(tag.corners_px, expected) / allowed_jump(edge, motion);
  }
  if (before == nullptr && after == nullptr) return std::nullopt;
  const TagObservation& other = before != nullptr ? *before : *after;
  return corner_distance_px(tag.corners_px, other.corners_px) / allowed_jump(2.0 * edge, 0.0);
}

// The sighting of a group (one id in one frame) to believe, or nothing where they cannot be told
// apart.
std::optional<std::size_t> choose(const std::vector<TagObservation>& group,
                                  const TagObservation* before, const TagObservation* after,
                                  const std::vector<double>& times) {
  std::vector<std::size_t> near;
  for (std::size_t i = 0; i < group.size(); ++i) {
    const std::optional<double> share = jump(group[i], before, after, times);
    if (share && *share <= 1.0) near.push_back(i);
  }
  if (near.size() == 1) return near.front();
  std::size_t best = 0;
  for (std::size_t i = 1; i < group.size(); ++i) {
    if (group[i].decision_margin > group[best].decision_margin) best = i;
  }
  for (std::size_t i = 0; i < group.size(); ++i) {
    if (i == best) continue;
    const bool same_place = is_same_place(group[i].corners_px, group[best].corners_px);
    const bool weaker = group[best].decision_margin > kMarginRatio * group[i].decision_margin;
    if (!same_place && !weaker) return std::nullopt;
  }
  return best;
}

// The frames in which each id was seen more than once, after one of them was chosen or all were put
// aside.
std::map<TagId, int> settle_doubles(TagObservations& all) {
  Sightings single;
  std::vector<std::vector<TagObservation>> doubles;
  for (std::size_t i = 0; i < all.observations.size();) {
    std::size_t end = i + 1;
    const auto same = [&](std::size_t k) {
      return all.observations[k].frame == all.observations[i].frame &&
             all.observations[k].id == all.observations[i].id;
    };
    while (end < all.observations.size() && same(end)) ++end;
    if (end == i + 1) {
      single.push_back(all.observations[i]);
    } else {
      doubles.emplace_back(all.observations.begin() + static_cast<std::ptrdiff_t>(i),
                           all.observations.begin() + static_cast<std::ptrdiff_t>(end));
    }
    i = end;
  }
  std::map<TagId, int> count;
  const auto tracks = by_marker(single);
  Sightings chosen;
  for (const std::vector<TagObservation>& group : doubles) {
    const TagId id = group.front().id;
    const TagObservation* before = nullptr;
    const TagObservation* after = nullptr;
    if (const auto track = tracks.find(id); track != tracks.end()) {
      const auto next = std::ranges::upper_bound(track->second, group.front().frame, {},
                                                 [](const TagObservation* t) { return t->frame; });
      if (next != track->second.end()) after = *next;
      if (next != track->second.begin()) before = *std::prev(next);
    }
    const std::optional<std::size_t> keep = choose(group, before, after, all.times_s);
    ++count[id];
    for (std::size_t i = 0; i < group.size(); ++i) {
      if (keep == i) {
        chosen.push_back(group[i]);
      } else {
        reject(all, group[i],
               keep ? "a second marker of this id in the frame"
                    : "two markers of this id in the frame, not to be told apart");
      }
    }
  }
  single.insert(single.end(), chosen.begin(), chosen.end());
  all.observations = std::move(single);
  sort_detections(all.observations);
  return count;
}

void reject_jumps(TagObservations& all) {
  std::map<std::pair<int, TagId>, bool> jumped;
  for (const auto& [id, track] : by_marker(all.observations)) {
    for (std::size_t i = 1; i + 1 < track.size(); ++i) {
      const double span = all.times_s[static_cast<std::size_t>(track[i + 1]->frame)] -
                          all.times_s[static_cast<std::size_t>(track[i - 1]->frame)];
      if (span > 2.0 * kNearby_s) continue;
      const auto share = jump(*track[i], track[i - 1], track[i + 1], all.times_s);
      // Both neighbours must be near: else a single one says nothing of a jump.
      if (share && *share > 1.0) jumped[{track[i]->frame, id}] = true;
    }
  }
  keep_if(all, [&](const TagObservation& tag) -> std::optional<std::string> {
    if (!jumped.contains({tag.frame, tag.id})) return std::nullopt;
    return "jumps away from its neighbours in time and back";
  });
}

void reject_rare(TagObservations& all, int min_sightings) {
  const int frames = static_cast<int>(all.times_s.size());
  const int least = std::min(min_sightings, std::max(1, frames / 10));
  std::map<TagId, int> seen;
  for (const TagObservation& tag : all.observations) ++seen[tag.id];
  keep_if(all, [&](const TagObservation& tag) -> std::optional<std::string> {
    if (seen[tag.id] >= least) return std::nullopt;
    return fmt::format("id seen in fewer than {} frames", least);
  });
}

void sort_rejected(TagObservations& all) {
  std::ranges::sort(all.rejected, {}, [](const RejectedTag& tag) {
    return std::tuple(tag.frame, tag.id, tag.reason);
  });
}

}  // namespace

double mean_edge_px(const std::vector<Eigen::Vector2d>& corners_px) {
  double sum = 0.0;
  for (std::size_t i = 0; i < corners_px.size(); ++i) {
    sum += (corners_px[i] - corners_px[(i + 1) % corners_px.size()]).norm();
  }
  return sum / static_cast<double>(corners_px.size());
}

double corner_distance_px(const std::vector<Eigen::Vector2d>& a,
                          const std::vector<Eigen::Vector2d>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).norm();
  return sum / static_cast<double>(a.size());
}

bool is_same_place(const std::vector<Eigen::Vector2d>& a, const std::vector<Eigen::Vector2d>& b) {
  constexpr double kOfEdge = 0.25;
  return corner_distance_px(a, b) < kOfEdge * mean_edge_px(b);
}

std::vector<Eigen::Vector2d> corners_between(const TagObservation& a, double time_a_s,
                                             const TagObservation& b, double time_b_s,
                                             double time_s) {
  const double part = (time_s - time_a_s) / (time_b_s - time_a_s);
  std::vector<Eigen::Vector2d> out;
  for (std::size_t i = 0; i < a.corners_px.size(); ++i) {
    out.emplace_back((1.0 - part) * a.corners_px[i] + part * b.corners_px[i]);
  }
  return out;
}

std::optional<std::string> impossible_shape(const std::vector<Eigen::Vector2d>& corners_px) {
  double shortest = 1e9;
  double longest = 0.0;
  int left = 0;
  int right = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d a = corners_px[(i + 1) % 4] - corners_px[i];
    const Eigen::Vector2d b = corners_px[(i + 2) % 4] - corners_px[(i + 1) % 4];
    if (!a.allFinite()) return "corners are no numbers";
    shortest = std::min(shortest, a.norm());
    longest = std::max(longest, a.norm());
    (a.x() * b.y() - a.y() * b.x() < 0.0 ? left : right) += 1;
  }
  // lb, rb, rt, lt turn to the left on the screen (y down).
  if (right == 4) return "mirrored";
  if (left != 4) return "corners are not convex";
  if (shortest < kLeastEdge_px) return "too small";
  if (shortest < kLeastEdgeRatio * longest) return "too oblique";
  return std::nullopt;
}

std::vector<std::string> sort_out_sightings(TagObservations& observations, const MarkerSet& markers,
                                            int min_sightings) {
  sort_detections(observations.observations);
  keep_if(observations, [&](const TagObservation& tag) { return undeclared(tag, markers); });
  keep_if(observations, [](const TagObservation& tag) { return impossible_shape(tag.corners_px); });
  keep_if(observations, [](const TagObservation& tag) -> std::optional<std::string> {
    if (!tag.partly_hidden) return std::nullopt;
    return "something covers a part of it";
  });
  const auto second_markers = put_second_markers_aside(observations, min_sightings);
  const std::map<TagId, int> doubles = settle_doubles(observations);
  reject_jumps(observations);
  reject_rare(observations, min_sightings);
  sort_rejected(observations);

  std::vector<std::string> warnings;
  for (const auto& [id, taken] : second_markers) {
    warnings.push_back(two_markers_warning(id, taken));
  }
  for (const auto& [id, count] : doubles) {
    if (count < std::max(2, min_sightings) || second_markers.contains(id)) continue;
    warnings.push_back(fmt::format(
        "marker {} is seen twice in {} frames: are there two with this id?", id.value, count));
  }
  const auto tracks = by_marker(observations.observations);
  for (const auto& [id, size] : markers.sizes_m) {
    if (!tracks.contains(id) && !second_markers.contains(id)) {
      warnings.push_back(fmt::format("marker {} is declared and never seen", id.value));
    }
  }
  return warnings;
}

void put_unfitted_aside(TagObservations& observations) {
  std::map<TagId, double> fitted;  // share
  for (const auto& [id, track] : by_marker(observations.observations)) {
    const auto count =
        std::ranges::count(track, true, [](const TagObservation* tag) { return tag->fitted; });
    fitted[id] = static_cast<double>(count) / static_cast<double>(track.size());
  }
  keep_if(observations, [&](const TagObservation& tag) -> std::optional<std::string> {
    if (tag.fitted || fitted[tag.id] < kNearlyAll) return std::nullopt;
    return "its corners could not be fitted, those of its other sightings could";
  });
  sort_rejected(observations);
}

}  // namespace kinescope
