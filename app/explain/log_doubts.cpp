// SPDX-License-Identifier: Apache-2.0
#include "app/explain/log_doubts.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/median.h"
#include "kinematics/log/log_faults.h"

namespace kinescope {
namespace {

constexpr double kShortestS = 2.0;
constexpr double kClocksS = 0.5;  // by which the two clocks may differ
constexpr double kShareOfRange = 0.1;
constexpr double kStepsInRange = 10.0;  // a marker at rest scatters over few of its own steps

struct Place {
  double time_s = 0.0;
  Eigen::Vector3d at;  // px of its middle, or m
};

// Of a marker by a camera.
using Places = std::map<std::pair<TagId, int>, std::vector<Place>>;

Places places_of(const Observed& observed) {
  const Measurements& measured = observed.measurements;
  Places out;
  const auto time = [&](int frame) { return measured.times_s[static_cast<std::size_t>(frame)]; };
  for (const TagObservation& tag : measured.corners) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector2d& corner : tag.corners_px) sum.head<2>() += corner;
    const int camera = measured.camera_of_frame.empty()
                           ? 0
                           : measured.camera_of_frame[static_cast<std::size_t>(tag.frame)];
    out[{tag.id, camera}].push_back(
        {time(tag.frame), sum / static_cast<double>(tag.corners_px.size())});
  }
  for (const PoseTrack& track : measured.poses.tracks) {
    for (const PoseSample& sample : track.samples) {
      out[{track.id, 0}].push_back({time(sample.frame), sample.T_camera_marker.translation});
    }
  }
  for (const PointObservation& point : measured.points.observations) {
    if (point.position_m) out[{point.id, 0}].push_back({time(point.frame), *point.position_m});
  }
  for (auto& [seen, places] : out) std::ranges::sort(places, {}, &Place::time_s);
  return out;
}

// Diagonal of the box that holds them.
double range_of(const std::vector<Place>& places) {
  if (places.empty()) return 0.0;
  Eigen::Vector3d low = places.front().at;
  Eigen::Vector3d high = low;
  for (const Place& place : places) {
    low = low.cwiseMin(place.at);
    high = high.cwiseMax(place.at);
  }
  return (high - low).norm();
}

double usual_step(const std::vector<Place>& places) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < places.size(); ++i) {
    steps.push_back((places[i].at - places[i - 1].at).norm());
  }
  return median_of(std::move(steps));
}

// A marker that moves clear of its noise in this time, and how far.
std::optional<std::pair<TagId, double>> moving_in(const Places& places, double from_s,
                                                  double to_s) {
  std::optional<std::pair<TagId, double>> most;
  for (const auto& [seen, all] : places) {
    std::vector<Place> inside;
    std::ranges::copy_if(all, std::back_inserter(inside), [&](const Place& place) {
      return place.time_s > from_s && place.time_s < to_s;
    });
    const double range = range_of(all);
    const double moved = range_of(inside);
    if (moved < kShareOfRange * range || range < kStepsInRange * usual_step(all)) continue;
    if (!most || moved > most->second) most = std::pair(seen.first, moved);
  }
  return most;
}

}  // namespace

std::vector<std::string> clock_jump_words(const JointLog& log) {
  std::vector<std::string> out;
  for (const ClockJump& jump : clock_jumps(log)) {
    out.push_back(fmt::format(
        "{}: the clock jumps by {:.3g} s behind {} = {:.6g}, where the joints go on as if no time "
        "had passed: readings behind it are late; correct the stamps, or cut the log there",
        log.source, jump.by_s, log.time_column, jump.after_s));
  }
  return out;
}

std::vector<std::string> frozen_log_words(const JointLog& log, const Observed& observed) {
  std::vector<std::string> out;
  const std::vector<RepeatedStretch> stretches = repeated_stretches(log, kShortestS);
  if (stretches.empty()) return out;
  const Places places = places_of(observed);
  const bool pixels = !observed.measurements.corners.empty();
  for (const RepeatedStretch& stretch : stretches) {
    const auto moving = moving_in(places, stretch.from_s + kClocksS, stretch.to_s - kClocksS);
    if (!moving) continue;
    const auto [id, moved] = *moving;
    out.push_back(fmt::format(
        "{}: repeats one row from {} = {:.6g} to {:.6g}, while tag_{} moves by {:.3g} {}: the log "
        "was frozen (take these rows out), or joints move that it does not have",
        log.source, log.time_column, stretch.from_s, stretch.to_s, id.value,
        pixels ? moved : 1e3 * moved, pixels ? "px" : "mm"));
  }
  return out;
}

}  // namespace kinescope
