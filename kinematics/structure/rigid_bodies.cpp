// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/rigid_bodies.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "kinematics/structure/link_path.h"
#include "kinematics/structure/readings.h"
#include "kinematics/structure/rest.h"
#include "kinematics/structure/series.h"

namespace kinescope {
namespace {

using namespace structure_search;  // NOLINT(google-build-using-namespace): of the search's parts

constexpr std::size_t kFewestFrames = 8;
// Instants of which pairs are judged: two of many markers are seen together in few of them.
constexpr int kMostInstants = 1000;

Series series_of(PoseTracks tracks) {
  std::erase_if(tracks.tracks,
                [](const PoseTrack& track) { return track.samples.size() < kFewestFrames; });
  if (tracks.tracks.empty()) return {};
  return thinned(clean_series(tracks), kMostInstants);
}

Readings no_readings(const Series& series) { return readings_at({}, series, 0.0, 0.0); }

// Sets of bodies, joined pair by pair.
class Sets {
 public:
  explicit Sets(std::size_t count) : of_(count) { std::iota(of_.begin(), of_.end(), 0U); }
  [[nodiscard]] bool are_one(std::size_t a, std::size_t b) const { return of_[a] == of_[b]; }
  void join(std::size_t a, std::size_t b) {
    const auto [kept, gone] = std::minmax(of_[a], of_[b]);
    std::ranges::replace(of_, std::size_t{gone}, std::size_t{kept});
  }
  [[nodiscard]] std::size_t of(std::size_t k) const { return of_[k]; }

 private:
  std::vector<std::size_t> of_;
};

}  // namespace

std::vector<std::vector<TagId>> rigid_bodies(const PoseTracks& tracks) {
  const Series series = series_of(tracks);
  if (series.bodies.empty()) return {};
  const Readings readings = no_readings(series);
  Sets sets(series.bodies.size());
  for (std::size_t a = 0; a < series.bodies.size(); ++a) {
    for (std::size_t b = a + 1; b < series.bodies.size(); ++b) {
      if (sets.are_one(a, b)) continue;
      if (keep_relative_pose(series.bodies[a], series.bodies[b], readings)) sets.join(a, b);
    }
  }
  std::map<std::size_t, std::vector<TagId>> by_set;
  for (std::size_t k = 0; k < series.bodies.size(); ++k)
    by_set[sets.of(k)].push_back(series.bodies[k].id);
  std::vector<std::vector<TagId>> out;
  for (auto& [set, ids] : by_set) out.push_back(std::move(ids));
  std::ranges::stable_sort(out, std::ranges::greater{},
                           [](const std::vector<TagId>& ids) { return ids.size(); });
  return out;
}

bool is_any_at_rest(const PoseTracks& tracks) {
  const Series series = series_of(tracks);
  if (series.bodies.empty()) return false;
  const Readings readings = no_readings(series);
  const LinkPath camera = camera_path(series.size());
  return std::ranges::any_of(series.bodies,
                             [&](const Body& body) { return keeps_pose(body, camera, readings); });
}

}  // namespace kinescope
