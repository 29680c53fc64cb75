// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/pose_tracks_from_tags.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "calib/tracks/planar_pose.h"
#include "kinematics/core/chi_square.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

// How fast a marker may plausibly turn (rad/s, one standard deviation) and how much it may turn
// between frames on top of that: the branch that would need more is the wrong one.
constexpr double kTurnRate = 2.0;
constexpr double kTurnFloor = 0.05;
// No single step may count for more than this (chi-square): a real jump must stay possible.
constexpr double kMaxStepCost = 30.0;
// The sightings with the largest images used to find a focal length.
constexpr std::size_t kFocalViews = 120;

// Eight numbers less the pose's six are left to check a sighting; one in a thousand misfits more
// than this by noise.
constexpr double kFreedom = 2.0;
constexpr double kWorstMisfit = 13.8;

void widen(PlanarPose& pose, double variance) {
  const auto widen_branch = [variance](PlanarBranch& branch) {
    branch.chi_square /= variance;
    branch.covariance *= variance;
  };
  widen_branch(pose.best);
  if (pose.other) widen_branch(*pose.other);
}

// Corners that no pose explains have errors that are no noise (half hidden, blurred): as wrong as
// they show themselves to be (Birge 1932).
PlanarPose with_own_misfit(PlanarPose pose) {
  if (pose.best.chi_square > kWorstMisfit) widen(pose, pose.best.chi_square / kFreedom);
  return pose;
}

struct Candidate {
  int frame = 0;
  const TagObservation* seen = nullptr;
  PlanarPose pose;
  double freedom = kFreedom;
  [[nodiscard]] int count() const { return pose.other ? 2 : 1; }
  [[nodiscard]] const PlanarBranch& branch(int k) const { return k == 0 ? pose.best : *pose.other; }
};

double step_cost(const PlanarBranch& a, const PlanarBranch& b, double dt_s) {
  const double angle = angle_between(a.T_camera_marker.rotation, b.T_camera_marker.rotation);
  const double noise =
      a.covariance.topLeftCorner<3, 3>().trace() + b.covariance.topLeftCorner<3, 3>().trace();
  const double spread = kTurnFloor + kTurnRate * dt_s;
  return std::min(kMaxStepCost, angle * angle / (spread * spread + noise));
}

// How much larger the variance of the corners is than was declared, or assumed where nothing was.
// Half of the sightings fit better than the median, whatever the worst do. Where the corners fit
// better than they should, what they declared may hold errors that a pose takes up: it stays.
double variance_of_corners(const std::map<TagId, std::vector<Candidate>>& candidates) {
  std::vector<double> shares;
  for (const auto& [id, list] : candidates) {
    for (const Candidate& c : list) {
      shares.push_back(c.pose.best.chi_square / chi_square_quantile(c.freedom, 0.0));
    }
  }
  return std::max(1.0, median_of(std::move(shares)));
}

// The most probable sequence of branches (Viterbi).
std::vector<int> choose_branches(const std::vector<Candidate>& candidates,
                                 const std::vector<double>& times_s) {
  std::vector<std::array<double, 2>> cost(candidates.size());
  std::vector<std::array<int, 2>> from(candidates.size());
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    for (int k = 0; k < candidates[i].count(); ++k) {
      const auto slot = static_cast<std::size_t>(k);
      cost[i][slot] = candidates[i].branch(k).chi_square;
      if (i == 0) continue;
      const double dt = times_s[static_cast<std::size_t>(candidates[i].frame)] -
                        times_s[static_cast<std::size_t>(candidates[i - 1].frame)];
      double best = std::numeric_limits<double>::infinity();
      for (int m = 0; m < candidates[i - 1].count(); ++m) {
        const double total = cost[i - 1][static_cast<std::size_t>(m)] +
                             step_cost(candidates[i - 1].branch(m), candidates[i].branch(k), dt);
        if (total < best) {
          best = total;
          from[i][slot] = m;
        }
      }
      cost[i][slot] += best;
    }
  }
  std::vector<int> chosen(candidates.size(), 0);
  if (candidates.empty()) return chosen;
  const std::size_t last = candidates.size() - 1;
  chosen[last] = candidates[last].count() == 2 && cost[last][1] < cost[last][0] ? 1 : 0;
  for (std::size_t i = last; i > 0; --i) {
    chosen[i - 1] = from[i][static_cast<std::size_t>(chosen[i])];
  }
  return chosen;
}

struct RestingView {
  TagObservation view;
  std::vector<char> has_part;  // of every candidate: it is of the marker where that rests
};

// The corners of a marker that mostly rests in one place, as one view: far more exact than any of
// its own. Nothing where it moves. A joint that moves for a while only has most of its views there
// and yet others elsewhere.
std::optional<RestingView> resting_view(const std::vector<Candidate>& candidates, double variance) {
  constexpr std::size_t kFewest = 8;
  // Variance of the corners about their medians, over the declared one, of a marker that moves by
  // so little that all views show one branch.
  constexpr double kHardlyMoves = 4.0;
  if (candidates.size() < kFewest) return std::nullopt;
  RestingView out{*candidates.front().seen, {}};
  TagObservation& view = out.view;
  for (std::size_t c = 0; c < view.corners_px.size(); ++c) {
    for (const Eigen::Index axis : {0, 1}) {
      std::vector<double> places;
      for (const Candidate& candidate : candidates)
        places.push_back(candidate.seen->corners_px[c][axis]);
      view.corners_px[c][axis] = median_of(std::move(places));
    }
  }
  std::vector<double> squared;
  std::vector<double> sigmas;
  for (const Candidate& candidate : candidates) {
    double sum = 0.0;
    for (std::size_t c = 0; c < view.corners_px.size(); ++c)
      sum += (candidate.seen->corners_px[c] - view.corners_px[c]).squaredNorm();
    sigmas.push_back(candidate.seen->sigma_px * std::sqrt(variance));
    squared.push_back(sum / (sigmas.back() * sigmas.back()));
  }
  const double limit = kHardlyMoves * 2.0 * static_cast<double>(view.corners_px.size());
  for (const double of_view : squared) out.has_part.push_back(of_view > limit ? 0 : 1);
  if (median_of(std::move(squared)) > limit) return std::nullopt;
  // The median of n has pi / 2 times the variance of their mean.
  view.sigma_px = median_of(std::move(sigmas)) *
                  std::sqrt(0.5 * std::numbers::pi / static_cast<double>(candidates.size()));
  return out;
}

// Of a marker that rests, the branches nearer to its one pose stand first, and the others cost what
// all views say against them together.
void settle_resting(const PlanarPose& rest, const std::vector<char>& rests, PoseTrack& track) {
  for (std::size_t i = 0; i < track.samples.size(); ++i) {
    PoseSample& s = track.samples[i];
    if (rests[i] == 0 || !s.T_camera_marker_alternative) continue;
    const Eigen::Quaterniond& rotation = rest.best.T_camera_marker.rotation;
    if (angle_between(s.T_camera_marker_alternative->rotation, rotation) <
        angle_between(s.T_camera_marker.rotation, rotation)) {
      std::swap(s.T_camera_marker, *s.T_camera_marker_alternative);
      std::swap(s.covariance, *s.alternative_covariance);
      s.alternative_cost = -s.alternative_cost;
    }
    if (rest.other) {
      s.alternative_cost =
          std::max(s.alternative_cost, rest.other->chi_square - rest.best.chi_square);
    }
  }
}

// Of a marker whose one pose is known: each view told about that.
void tell_about(const PlanarPose& rest, const std::vector<char>& rests,
                const std::vector<Candidate>& candidates, const CameraModel& camera,
                const std::vector<Eigen::Vector3d>& corners_m, double variance, PoseTrack& track) {
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (rests[i] == 0) continue;
    const TagObservation& seen = *candidates[i].seen;
    const auto about =
        pose_about(camera, corners_m, seen.corners_px, seen.sigma_px, rest.best.T_camera_marker);
    if (!about) continue;
    PlanarPose pose{*about, {}};
    widen(pose, variance);
    pose = with_own_misfit(std::move(pose));
    PoseSample& sample = track.samples[i];
    sample = {.frame = sample.frame,
              .T_camera_marker = pose.best.T_camera_marker,
              .covariance = pose.best.covariance,
              .T_camera_marker_alternative = {}};
  }
}

PoseTrack make_track(TagId id, const std::vector<Candidate>& candidates,
                     const std::vector<double>& times_s) {
  PoseTrack track{id, {}};
  const std::vector<int> chosen = choose_branches(candidates, times_s);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const PlanarBranch& branch = candidates[i].branch(chosen[i]);
    PoseSample sample;
    sample.frame = candidates[i].frame;
    sample.T_camera_marker = branch.T_camera_marker;
    sample.covariance = branch.covariance;
    if (candidates[i].count() == 2) {
      const PlanarBranch& other = candidates[i].branch(1 - chosen[i]);
      sample.T_camera_marker_alternative = other.T_camera_marker;
      sample.alternative_cost = other.chi_square - branch.chi_square;
      sample.alternative_covariance = other.covariance;
    }
    track.samples.push_back(std::move(sample));
  }
  return track;
}

double perimeter(const TagObservation& observation) {
  double sum = 0.0;
  for (std::size_t i = 0; i < observation.corners_px.size(); ++i) {
    sum += (observation.corners_px[i] -
            observation.corners_px[(i + 1) % observation.corners_px.size()])
               .norm();
  }
  return sum;
}

// Robust misfit of all views, each with its own pose, for one focal length.
double focal_cost(const CameraModel& camera, const std::vector<const TagObservation*>& views,
                  const MarkerSet& markers) {
  constexpr double kCap = 1e4;  // a view that does not fit at any focal length must not decide
  double sum = 0.0;
  for (const TagObservation* view : views) {
    const auto pose =
        estimate_planar_pose(camera, markers.corners_m(view->id), view->corners_px, view->sigma_px);
    sum += pose ? std::min(kCap, pose->best.chi_square) : kCap;
  }
  return sum;
}

}  // namespace

PoseTracks pose_tracks_from_tags(const TagObservations& observations, const CameraModel& camera,
                                 const MarkerSet& markers) {
  std::map<TagId, std::vector<Candidate>> candidates;
  for (const TagObservation& observation : observations.observations) {
    const auto pose = estimate_planar_pose(camera, markers.corners_m(observation.id),
                                           observation.corners_px, observation.sigma_px);
    if (!pose) continue;
    const double freedom = 2.0 * static_cast<double>(observation.corners_px.size()) - 6.0;
    candidates[observation.id].push_back({observation.frame, &observation, *pose, freedom});
  }
  const double variance = variance_of_corners(candidates);
  PoseTracks tracks{observations.times_s, {}};
  for (auto& [id, list] : candidates) {
    for (Candidate& c : list) {
      widen(c.pose, variance);
      c.pose = with_own_misfit(std::move(c.pose));
    }
    std::ranges::sort(list, {}, &Candidate::frame);
    tracks.tracks.push_back(make_track(id, list, observations.times_s));
    const auto resting = resting_view(list, variance);
    if (!resting) continue;
    const auto rest = estimate_planar_pose(camera, markers.corners_m(id), resting->view.corners_px,
                                           resting->view.sigma_px);
    if (!rest) continue;
    PoseTrack& track = tracks.tracks.back();
    settle_resting(*rest, resting->has_part, track);
    if (!rest->other || rest->other->chi_square - rest->best.chi_square > kWorstMisfit) {
      tell_about(*rest, resting->has_part, list, camera, markers.corners_m(id), variance, track);
    }
  }
  return tracks;
}

double focal_from_tags(const TagObservations& observations, const MarkerSet& markers) {
  std::vector<const TagObservation*> views;
  for (const TagObservation& observation : observations.observations) {
    views.push_back(&observation);
  }
  std::ranges::stable_sort(views, [](const TagObservation* a, const TagObservation* b) {
    return perimeter(*a) > perimeter(*b);
  });
  if (views.size() > kFocalViews) views.resize(kFocalViews);

  const auto cost = [&](double log_focal) {
    return focal_cost(pinhole_guess(observations.width, observations.height, std::exp(log_focal)),
                      views, markers);
  };
  constexpr int kGrid = 24;
  const double low = std::log(0.4 * observations.width);
  const double step = std::log(10.0) / kGrid;
  int best = 0;
  std::vector<double> costs;
  for (int i = 0; i <= kGrid; ++i) {
    costs.push_back(cost(low + i * step));
    if (costs.back() < costs[static_cast<std::size_t>(best)]) best = i;
  }
  if (best == 0 || best == kGrid) {
    throw undetermined("camera", "the focal length cannot be seen in the markers' shapes",
                       "give a camera.yaml (kinescope camera makes one), or film the markers "
                       "larger and more tilted");
  }
  // Golden section between the neighbours.
  const double ratio = 0.5 * (std::sqrt(5.0) - 1.0);
  double a = low + (best - 1) * step;
  double b = low + (best + 1) * step;
  for (int i = 0; i < 24; ++i) {
    const double c = b - ratio * (b - a);
    const double d = a + ratio * (b - a);
    if (cost(c) < cost(d)) {
      b = d;
    } else {
      a = c;
    }
  }
  return std::exp(0.5 * (a + b));
}

}  // namespace kinescope
