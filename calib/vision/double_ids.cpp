// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/double_ids.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>
#include <set>
#include <vector>

#include <fmt/format.h>

#include "calib/vision/sightings.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kLink_s = 0.5;         // longer gaps are bridged at the same place only
constexpr double kLinkOfEdge = 0.75;    // a link may be off by this share of the marker's edge ..
constexpr double kLinkOfMotion = 0.75;  // .. or of its way since it was seen
constexpr double kNewOfEdge = 1.5;      // of the edge, where no velocity is known yet
constexpr std::size_t kTracklet = 3;    // sightings; shorter ones are looked at together
constexpr double kAtRest = 0.9;         // share of the sightings that are where most of them are
constexpr int kTogether = 2;            // frames in which two tracklets must be seen together
constexpr double kFew = 0.2;            // a side with this share of the other's sightings ..
constexpr double kWeaker = 1.5;         // .. and that much less contrast is no marker

using Sighting = const TagObservation*;
using CornerPoints = std::vector<Eigen::Vector2d>;

Eigen::Vector2d centre(const CornerPoints& corners) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : corners) sum += corner;
  return sum / static_cast<double>(corners.size());
}

// One or several tracklets that are of one marker.
struct Node {
  std::vector<Sighting> seen;  // by frame
  bool moves = false;
  CornerPoints place;  // of a node at rest
};

class Doubles {
 public:
  explicit Doubles(const std::vector<double>& times_s) : times_s_(times_s) {}

  // Sightings of one id, by frame.
  [[nodiscard]] std::vector<Node> nodes(const std::vector<Sighting>& sightings,
                                        std::size_t least) const {
    std::vector<Node> out;
    Node rest;  // what is too short to be linked: postures, or wrong detections
    for (std::vector<Sighting>& tracklet : link(sightings)) {
      if (tracklet.size() < kTracklet) {
        rest.seen.insert(rest.seen.end(), tracklet.begin(), tracklet.end());
      } else {
        add(std::move(tracklet), out);
      }
    }
    constexpr std::size_t kWrongOnes = 10;  // one in so many sightings may be
    if (rest.seen.size() >= std::max(least, sightings.size() / kWrongOnes)) {
      std::ranges::sort(rest.seen, {}, &TagObservation::frame);
      rest.moves = true;
      out.push_back(std::move(rest));
    }
    for (Node& node : out) std::ranges::stable_sort(node.seen, {}, &TagObservation::frame);
    return out;
  }

  // Frames of `a` in which `b` is seen too, elsewhere, or just before and just after.
  [[nodiscard]] int together(const Node& a, const Node& b) const {
    int count = 0;
    for (const Sighting sighting : a.seen) {
      const auto next =
          std::ranges::lower_bound(b.seen, sighting->frame, {}, &TagObservation::frame);
      const auto is_elsewhere = [&](Sighting other) {
        return (centre(other->corners_px) - centre(sighting->corners_px)).norm() >
               0.5 * mean_edge_px(other->corners_px);
      };
      if (next == b.seen.end() || !is_elsewhere(*next)) continue;
      if ((*next)->frame == sighting->frame) {
        ++count;
      } else if (next != b.seen.begin() && time(*next) - time(sighting) < kNearby_s &&
                 time(sighting) - time(*std::prev(next)) < kNearby_s &&
                 is_elsewhere(*std::prev(next))) {
        ++count;
      }
    }
    return count;
  }

 private:
  [[nodiscard]] double time(Sighting s) const {
    return times_s_[static_cast<std::size_t>(s->frame)];
  }

  // How far a sighting is from where a tracklet leads, as a share of what is allowed.
  [[nodiscard]] std::optional<double> distance(const std::vector<Sighting>& tracklet,
                                               Sighting next) const {
    const Sighting last = tracklet.back();
    if (last->frame == next->frame) return std::nullopt;
    if (is_same_place(next->corners_px, last->corners_px)) return 0.0;
    const double dt = time(next) - time(last);
    if (dt > kLink_s) return std::nullopt;
    const double edge = mean_edge_px(last->corners_px);
    const Eigen::Vector2d from = centre(last->corners_px);
    Eigen::Vector2d way = Eigen::Vector2d::Zero();
    double allowed = kNewOfEdge * edge;
    if (tracklet.size() > 1) {
      const Sighting before = tracklet[tracklet.size() - 2];
      way = (from - centre(before->corners_px)) * dt / (time(last) - time(before));
      allowed = std::max(kLinkOfEdge * edge, kLinkOfMotion * way.norm());
    }
    const double share = (centre(next->corners_px) - from - way).norm() / allowed;
    if (share > 1.0) return std::nullopt;
    return share;
  }

  [[nodiscard]] std::vector<std::vector<Sighting>> link(
      const std::vector<Sighting>& sightings) const {
    std::vector<std::vector<Sighting>> tracklets;
    for (std::size_t begin = 0; begin < sightings.size();) {
      std::size_t end = begin;
      while (end < sightings.size() && sightings[end]->frame == sightings[begin]->frame) ++end;
      std::vector<Sighting> left(sightings.begin() + static_cast<std::ptrdiff_t>(begin),
                                 sightings.begin() + static_cast<std::ptrdiff_t>(end));
      begin = end;
      while (!left.empty()) {
        double nearest = 0.0;
        std::optional<std::pair<std::size_t, std::size_t>> best;  // tracklet, sighting
        for (std::size_t t = 0; t < tracklets.size(); ++t) {
          for (std::size_t s = 0; s < left.size(); ++s) {
            const auto far = distance(tracklets[t], left[s]);
            if (far && (!best || *far < nearest)) {
              best = {t, s};
              nearest = *far;
            }
          }
        }
        if (!best) {
          best = {tracklets.size(), 0};
          tracklets.emplace_back();
        }
        const Sighting taken = left[best->second];
        tracklets[best->first].push_back(taken);
        // A marker that was detected twice is still one.
        std::erase_if(left, [&](Sighting s) {
          return s == taken || is_same_place(s->corners_px, taken->corners_px);
        });
      }
    }
    return tracklets;
  }

  // As a node of its own, or with the others at rest in the same place.
  static void add(std::vector<Sighting> tracklet, std::vector<Node>& nodes) {
    Node node{.seen = std::move(tracklet), .moves = false, .place = {}};
    const std::size_t corners = node.seen.front()->corners_px.size();
    for (std::size_t c = 0; c < corners; ++c) {
      std::vector<double> x;
      std::vector<double> y;
      for (const Sighting s : node.seen) {
        x.push_back(s->corners_px[c].x());
        y.push_back(s->corners_px[c].y());
      }
      node.place.emplace_back(median_of(std::move(x)), median_of(std::move(y)));
    }
    const auto there = std::ranges::count_if(
        node.seen, [&](Sighting s) { return is_same_place(s->corners_px, node.place); });
    node.moves = static_cast<double>(there) < kAtRest * static_cast<double>(node.seen.size());
    for (Node& other : nodes) {
      if (node.moves || other.moves || !is_same_place(node.place, other.place)) continue;
      other.seen.insert(other.seen.end(), node.seen.begin(), node.seen.end());
      return;
    }
    nodes.push_back(std::move(node));
  }

  const std::vector<double>& times_s_;
};

// One of the two markers: the nodes of one colour.
struct Side {
  std::vector<Sighting> seen;
  int nodes = 0;
  bool moves = false;

  void add(const Node& node) {
    seen.insert(seen.end(), node.seen.begin(), node.seen.end());
    moves = moves || node.moves || nodes > 0;  // two places at rest are a move between them
    ++nodes;
  }
  [[nodiscard]] double margin() const {
    std::vector<double> margins;
    for (const Sighting s : seen) margins.push_back(s->decision_margin);
    return median_of(std::move(margins));
  }
};

// Hardly seen beside the other one, and badly: a pattern that is taken for a marker.
bool is_ghost_of(const Side& side, const Side& other) {
  return static_cast<double>(side.seen.size()) < kFew * static_cast<double>(other.seen.size()) &&
         kWeaker * side.margin() < other.margin();
}

struct Verdict {
  TakenMarker taken = TakenMarker::kNone;
  std::vector<Sighting> second;  // of the marker at rest
};

// Nothing where one marker explains all sightings.
std::optional<Verdict> judge(const std::vector<Sighting>& sightings,
                             const std::vector<double>& times_s, int min_sightings) {
  const Doubles doubles(times_s);
  const int least = std::max(kTogether, min_sightings);
  const std::vector<Node> nodes = doubles.nodes(sightings, static_cast<std::size_t>(least));
  const std::size_t n = nodes.size();
  std::vector<std::vector<int>> together(n, std::vector<int>(n, 0));
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = a + 1; b < n; ++b) {
      together[a][b] = together[b][a] =
          std::max(doubles.together(nodes[a], nodes[b]), doubles.together(nodes[b], nodes[a]));
    }
  }
  std::optional<Verdict> verdict;
  std::vector<int> colour(n, -1);
  for (std::size_t first = 0; first < n; ++first) {
    if (colour[first] >= 0) continue;
    std::array<Side, 2> sides;
    std::vector<std::size_t> open{first};
    colour[first] = 0;
    int overlap = 0;
    bool two_colours = true;
    for (std::size_t k = 0; k < open.size(); ++k) {
      const std::size_t a = open[k];
      sides[static_cast<std::size_t>(colour[a])].add(nodes[a]);
      for (std::size_t b = 0; b < n; ++b) {
        if (together[a][b] < kTogether) continue;
        overlap += together[a][b];
        if (colour[b] == colour[a]) two_colours = false;
        if (colour[b] >= 0) continue;
        colour[b] = 1 - colour[a];
        open.push_back(b);
      }
    }
    overlap /= 2;  // each pair was met from both of its ends
    if (overlap < least || is_ghost_of(sides[0], sides[1]) || is_ghost_of(sides[1], sides[0])) {
      continue;
    }
    if (!two_colours || sides[0].moves == sides[1].moves) return Verdict{};
    if (!verdict) verdict = Verdict{.taken = TakenMarker::kMoving, .second = {}};
    const Side& still = sides[0].moves ? sides[1] : sides[0];
    verdict->second.insert(verdict->second.end(), still.seen.begin(), still.seen.end());
  }
  return verdict;
}

}  // namespace

std::map<TagId, TakenMarker> put_second_markers_aside(TagObservations& observations,
                                                      int min_sightings) {
  std::map<TagId, std::vector<Sighting>> by_id;
  for (const TagObservation& tag : observations.observations) by_id[tag.id].push_back(&tag);
  std::map<TagId, TakenMarker> out;
  std::set<Sighting> second;
  for (const auto& [id, sightings] : by_id) {
    const auto verdict = judge(sightings, observations.times_s, min_sightings);
    if (!verdict) continue;
    out[id] = verdict->taken;
    second.insert(verdict->second.begin(), verdict->second.end());
  }
  std::vector<TagObservation> kept;
  for (const TagObservation& tag : observations.observations) {
    const auto found = out.find(tag.id);
    if (found != out.end() && found->second == TakenMarker::kNone) {
      observations.rejected.push_back(
          {tag.frame, tag.id, "two markers of this id, not to be told apart"});
    } else if (second.contains(&tag)) {
      observations.rejected.push_back({tag.frame, tag.id, "a second marker of this id, at rest"});
    } else {
      kept.push_back(tag);
    }
  }
  observations.observations = std::move(kept);
  return out;
}

std::string two_markers_warning(TagId id, TakenMarker taken) {
  return fmt::format("{} {} are in view: remove one ({})", kTwoMarkers, id.value,
                     taken == TakenMarker::kMoving ? "the one that moves is taken for the robot's"
                                                   : "neither is used, as it is not clear which "
                                                     "one is the robot's");
}

}  // namespace kinescope
