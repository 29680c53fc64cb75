// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/several_cameras.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "calib/tracks/interpolated_track.h"
#include "kinematics/core/mean_step.h"
#include "kinematics/core/median.h"
#include "kinematics/core/nearest_rotation.h"

namespace kinescope {
namespace {

using tracks::InterpolatedTrack;

// A marker of which this is not known, m.
constexpr double kUnknownSize = 0.05;
// Instants that a fit is made from; more of them change a start by nothing.
constexpr std::size_t kMostPairs = 1500;
// The same of a first scan over offsets of many seconds.
constexpr std::size_t kMostCoarsePairs = 250;
// The fewest common sightings that a camera is placed by.
constexpr std::size_t kFewestPairs = 4;

// A corner of a marker in both cameras' frames, m.
struct PointPair {
  Eigen::Vector3d reference;
  Eigen::Vector3d own;
};

using Corners = std::array<Eigen::Vector3d, 4>;

Corners corners_of(const MarkerSet& markers, TagId id) {
  const double size = markers.size_m(id);
  const double half = 0.5 * (size > 0.0 ? size : kUnknownSize);
  return {Eigen::Vector3d(-half, -half, 0.0),
          {half, -half, 0.0},
          {half, half, 0.0},
          {-half, half, 0.0}};
}

std::size_t sightings_of(const PoseTracks& tracks) {
  std::size_t count = 0;
  for (const PoseTrack& track : tracks.tracks) count += track.samples.size();
  return count;
}

InterpolatedTrack interpolated(const PoseTracks& all, const PoseTrack& track, bool bridge) {
  std::vector<double> times_s;
  std::vector<const PoseSample*> samples;
  for (const PoseSample& sample : track.samples) {
    times_s.push_back(all.times_s[static_cast<std::size_t>(sample.frame)]);
    samples.push_back(&sample);
  }
  return {std::move(times_s), std::move(samples),
          bridge ? tracks::kBridgedSteps * median_step_s(all.times_s) : 0.0};
}

// Weighted least squares of |reference - T own|.
Pose oriented(const std::vector<PointPair>& pairs, const Eigen::VectorXd& weights) {
  Eigen::Vector3d reference = Eigen::Vector3d::Zero();
  Eigen::Vector3d own = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double w = weights[static_cast<Eigen::Index>(i)] / weights.sum();
    reference += w * pairs[i].reference;
    own += w * pairs[i].own;
  }
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    spread += weights[static_cast<Eigen::Index>(i)] * (pairs[i].reference - reference) *
              (pairs[i].own - own).transpose();
  }
  Pose out;
  out.rotation = Eigen::Quaterniond(nearest_rotation(spread));
  out.translation = reference - out.rotation * own;
  return out;
}

struct Meeting {
  Pose T_reference_own;
  double misfit_m = std::numeric_limits<double>::infinity();  // median
};

Meeting meet(const std::vector<PointPair>& pairs) {
  constexpr int kWeightRounds = 8;  // of weights; the misfit stands still after five
  Meeting out;
  if (pairs.empty()) return out;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(pairs.size()));
  for (int round = 0; round < kWeightRounds; ++round) {
    out.T_reference_own = oriented(pairs, weights);
    std::vector<double> distances;
    for (const PointPair& pair : pairs)
      distances.push_back((pair.reference - out.T_reference_own * pair.own).norm());
    out.misfit_m = median_of(distances);
    const double width = std::max(out.misfit_m, 1e-9);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const double d = distances[i] / width;
      weights[static_cast<Eigen::Index>(i)] = 1.0 / (1.0 + d * d);
    }
  }
  return out;
}

// The markers of two cameras; `first` is placed already.
class CommonMarkers {
 public:
  CommonMarkers(const PoseTracks& first, const PoseTracks& second, const MarkerSet& markers)
      : second_(second), markers_(markers) {
    const bool bridge = !tracks::are_simultaneous(second.times_s, first.times_s);
    for (const PoseTrack& track : second.tracks) {
      const auto same = std::ranges::find(first.tracks, track.id, &PoseTrack::id);
      if (same == first.tracks.end() || same->samples.empty()) continue;
      common_.push_back({&track, interpolated(first, *same, bridge), marker_moves(*same)});
      count_ += track.samples.size();
    }
  }

  [[nodiscard]] bool any_moves() const { return std::ranges::any_of(common_, &Common::moves); }

  // With the second camera's clock so far behind the first's.
  [[nodiscard]] std::vector<PointPair> pairs(double ahead_s, bool moving_only,
                                             std::size_t most = kMostPairs) const {
    const std::size_t step = 1 + count_ / most;
    std::vector<PointPair> out;
    for (const Common& common : common_) {
      if (moving_only && !common.moves) continue;
      const Corners corners = corners_of(markers_, common.own->id);
      for (std::size_t i = 0; i < common.own->samples.size(); i += step) {
        const PoseSample& own = common.own->samples[i];
        const auto other =
            common.reference.at(second_.times_s[static_cast<std::size_t>(own.frame)] + ahead_s);
        if (!other) continue;
        for (const Eigen::Vector3d& corner : corners)
          out.push_back({other->T_camera_marker * corner, own.T_camera_marker * corner});
      }
    }
    return out;
  }

 private:
  struct Common {
    const PoseTrack* own;
    InterpolatedTrack reference;
    bool moves;
  };

  const PoseTracks& second_;
  const MarkerSet& markers_;
  std::vector<Common> common_;
  std::size_t count_ = 0;
};

// A clock that is right makes points meet several times as well as others do.
constexpr double kStandsOut = 0.5;

struct ClockScan {
  double best_s = 0.0;
  double least_m = std::numeric_limits<double>::infinity();
  double usual_m = std::numeric_limits<double>::infinity();
};

// Offsets at which fewer than half as many points meet as at others are not looked at: a short end
// of a motion meets anywhere.
ClockScan scan_clock(const CommonMarkers& common, double step_s, double about_s,
                     double half_width_s, std::size_t most_pairs) {
  const int steps = static_cast<int>(std::ceil(half_width_s / step_s));
  std::vector<std::vector<PointPair>> pairs;
  std::size_t most = 0;
  for (int k = -steps; k <= steps; ++k) {
    pairs.push_back(common.pairs(about_s + k * step_s, true, most_pairs));
    most = std::max(most, pairs.back().size());
  }
  ClockScan out;
  std::vector<double> all;
  for (int k = -steps; k <= steps; ++k) {
    const std::vector<PointPair>& at = pairs[static_cast<std::size_t>(k + steps)];
    if (at.size() < std::max(4 * kFewestPairs, most / 2)) continue;
    const double misfit_m = meet(at).misfit_m;
    all.push_back(misfit_m);
    if (misfit_m >= out.least_m) continue;
    out.least_m = misfit_m;
    out.best_s = about_s + k * step_s;
  }
  if (!all.empty()) out.usual_m = median_of(std::move(all));
  return out;
}

// The misfit is V-shaped about its least: halved intervals, to a hundredth of a step.
double refined_clock(const CommonMarkers& common, double step_s, const ClockScan& scan) {
  constexpr double kFine = 0.01;
  double best_s = scan.best_s;
  double least_m = meet(common.pairs(best_s, true)).misfit_m;
  for (double h = 0.5 * step_s; h > kFine * step_s; h *= 0.5) {
    for (const double other : {best_s - h, best_s + h}) {
      const std::vector<PointPair> pairs = common.pairs(other, true);
      if (pairs.size() < 4 * kFewestPairs) continue;
      const double misfit_m = meet(pairs).misfit_m;
      if (misfit_m >= least_m) continue;
      least_m = misfit_m;
      best_s = other;
    }
  }
  return best_s;
}

// The offset at which moving markers meet best; nothing where none stands out. One far off is taken
// where points meet there several times as well as at any near one.
std::optional<double> clock_by_motion(const CommonMarkers& common, double step_s, double about_s,
                                      const PlaceCamerasOptions& options) {
  if (!common.any_moves() || !(step_s > 0.0)) return std::nullopt;
  ClockScan best = scan_clock(common, step_s, about_s, options.max_offset_s, kMostPairs);
  const ClockScan far =
      scan_clock(common, step_s, about_s, options.max_far_offset_s, kMostCoarsePairs);
  if (far.least_m < kStandsOut * best.least_m) best = far;
  if (!(best.least_m <= kStandsOut * best.usual_m)) return std::nullopt;
  return refined_clock(common, step_s, best);
}

std::optional<CameraPlace> placed_by(const PoseTracks& placed, const PoseTracks& own,
                                     const MarkerSet& markers, double about_s,
                                     const PlaceCamerasOptions& options) {
  const CommonMarkers common(placed, own, markers);
  CameraPlace out;
  out.ahead_s = about_s;
  if (options.scan_clocks) {
    const double step_s = 0.5 * std::max(median_step_s(own.times_s), median_step_s(placed.times_s));
    if (const auto ahead_s = clock_by_motion(common, step_s, about_s, options)) {
      out.ahead_s = *ahead_s;
      out.clock_known = true;
    }
  } else {
    out.clock_known = true;
  }
  const std::vector<PointPair> pairs = common.pairs(out.ahead_s, false);
  if (pairs.size() < 4 * kFewestPairs) return std::nullopt;
  out.T_reference_camera = meet(pairs).T_reference_own;
  return out;
}

// Sightings of the markers that both saw.
std::size_t common_sightings(const PoseTracks& a, const PoseTracks& b) {
  std::size_t count = 0;
  for (const PoseTrack& track : a.tracks) {
    const auto same = std::ranges::find(b.tracks, track.id, &PoseTrack::id);
    if (same != b.tracks.end()) count += std::min(track.samples.size(), same->samples.size());
  }
  return count;
}

}  // namespace

bool marker_moves(const PoseTrack& track) {
  constexpr double kBeyondNoise = 10.0;
  if (track.samples.empty()) return false;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const PoseSample& sample : track.samples)
    mean += sample.T_camera_marker.translation / static_cast<double>(track.samples.size());
  std::vector<double> away, noise;
  for (const PoseSample& sample : track.samples) {
    away.push_back((sample.T_camera_marker.translation - mean).norm());
    noise.push_back(std::sqrt(sample.covariance.bottomRightCorner<3, 3>().trace()));
  }
  return median_of(std::move(away)) > kBeyondNoise * median_of(std::move(noise));
}

PlacedCameras place_cameras(const std::vector<PoseTracks>& tracks, const MarkerSet& markers,
                            const PlaceCamerasOptions& options) {
  PlacedCameras out;
  out.places.resize(tracks.size());
  if (tracks.empty()) return out;
  for (std::size_t c = 1; c < tracks.size(); ++c)
    if (sightings_of(tracks[c]) > sightings_of(tracks[out.reference])) out.reference = c;
  out.places[out.reference] = CameraPlace{{}, 0.0, true};
  const auto about_s = [&](std::size_t c) {
    return options.ahead_s.empty() ? 0.0 : options.ahead_s[c];
  };
  // Those that have most in common with a placed one first, as of a spanning tree (Prim 1957).
  std::set<std::pair<std::size_t, std::size_t>> failed;
  while (true) {
    std::size_t best = 0, from = 0, most = 0;
    for (std::size_t a = 0; a < tracks.size(); ++a) {
      for (std::size_t b = 0; b < tracks.size(); ++b) {
        if (!out.places[a] || out.places[b] || failed.contains({a, b})) continue;
        const std::size_t count = common_sightings(tracks[a], tracks[b]);
        if (count > most) std::tie(from, best, most) = std::tuple(a, b, count);
      }
    }
    if (most == 0) return out;
    auto place =
        placed_by(tracks[from], tracks[best], markers, about_s(best) - about_s(from), options);
    if (!place) {
      failed.emplace(from, best);
      continue;
    }
    const CameraPlace& parent = *out.places[from];
    place->T_reference_camera = parent.T_reference_camera * place->T_reference_camera;
    place->ahead_s += parent.ahead_s;
    place->clock_known = place->clock_known && parent.clock_known;
    out.places[best] = *place;
  }
}

CommonFrames merge_frames(const std::vector<std::vector<double>>& times_s) {
  std::vector<std::tuple<double, int, int>> all;  // time, camera, own frame
  CommonFrames out;
  for (std::size_t c = 0; c < times_s.size(); ++c) {
    out.frame_of.emplace_back(times_s[c].size(), 0);
    for (std::size_t f = 0; f < times_s[c].size(); ++f)
      all.emplace_back(times_s[c][f], static_cast<int>(c), static_cast<int>(f));
  }
  std::ranges::sort(all);
  for (const auto& [time_s, camera, frame] : all) {
    out.frame_of[static_cast<std::size_t>(camera)][static_cast<std::size_t>(frame)] =
        static_cast<int>(out.times_s.size());
    out.times_s.push_back(time_s);
    out.camera_of_frame.push_back(camera);
  }
  return out;
}

PoseTracks moved(PoseTracks tracks, const Pose& T_reference_camera) {
  for (PoseTrack& track : tracks.tracks) {
    for (PoseSample& sample : track.samples) {
      // The covariance is of a right perturbation, in the marker's frame.
      sample.T_camera_marker = T_reference_camera * sample.T_camera_marker;
      if (sample.T_camera_marker_alternative)
        sample.T_camera_marker_alternative =
            T_reference_camera * *sample.T_camera_marker_alternative;
    }
  }
  return tracks;
}

PoseTracks merged(const std::vector<PoseTracks>& tracks, std::vector<double> times_s) {
  std::map<TagId, PoseTrack> by_id;
  for (const PoseTracks& of_camera : tracks) {
    for (const PoseTrack& track : of_camera.tracks) {
      PoseTrack& all = by_id[track.id];
      all.id = track.id;
      all.samples.insert(all.samples.end(), track.samples.begin(), track.samples.end());
    }
  }
  PoseTracks out;
  out.times_s = std::move(times_s);
  for (auto& [id, track] : by_id) {
    std::ranges::sort(track.samples, {}, &PoseSample::frame);
    out.tracks.push_back(std::move(track));
  }
  return out;
}

std::vector<int> frames_of_reference(const std::vector<int>& camera_of_frame) {
  std::vector<int> out;
  for (std::size_t f = 0; f < camera_of_frame.size(); ++f)
    if (camera_of_frame[f] == 0) out.push_back(static_cast<int>(f));
  return out;
}

namespace {

// One marker's samples by camera, the camera that saw it most first.
std::vector<std::pair<int, std::vector<const PoseSample*>>> by_camera(
    const PoseTrack& track, const std::vector<int>& camera_of_frame) {
  std::map<int, std::vector<const PoseSample*>> cameras;
  for (const PoseSample& sample : track.samples)
    cameras[camera_of_frame[static_cast<std::size_t>(sample.frame)]].push_back(&sample);
  std::vector<std::pair<int, std::vector<const PoseSample*>>> out(cameras.begin(), cameras.end());
  std::ranges::stable_sort(out, std::greater{}, [](const auto& c) { return c.second.size(); });
  return out;
}

// How far each camera's tracks are interpolated, s.
std::map<int, double> bridges(const std::vector<double>& times_s,
                              const std::vector<int>& camera_of_frame) {
  std::map<int, std::vector<double>> own;
  for (std::size_t f = 0; f < times_s.size(); ++f) own[camera_of_frame[f]].push_back(times_s[f]);
  std::map<int, double> out;
  for (const auto& [camera, times] : own) {
    const bool exact = camera == 0 || tracks::are_simultaneous(times, own[0]);
    out[camera] = exact ? 0.0 : tracks::kBridgedSteps * median_step_s(times);
  }
  return out;
}

}  // namespace

PoseTracks at_common_instants(const PoseTracks& tracks, const std::vector<int>& camera_of_frame) {
  if (camera_of_frame.empty()) return tracks;
  PoseTracks out;
  for (const int frame : frames_of_reference(camera_of_frame))
    out.times_s.push_back(tracks.times_s[static_cast<std::size_t>(frame)]);
  const std::map<int, double> bridge_s = bridges(tracks.times_s, camera_of_frame);
  for (const PoseTrack& track : tracks.tracks) {
    std::vector<InterpolatedTrack> ways;
    for (auto& [camera, samples] : by_camera(track, camera_of_frame)) {
      std::vector<double> times_s;
      for (const PoseSample* sample : samples)
        times_s.push_back(tracks.times_s[static_cast<std::size_t>(sample->frame)]);
      ways.emplace_back(std::move(times_s), samples, bridge_s.at(camera));
    }
    PoseTrack common{track.id, {}};
    for (std::size_t k = 0; k < out.times_s.size(); ++k) {
      for (const InterpolatedTrack& way : ways) {
        std::optional<PoseSample> sample = way.at(out.times_s[k]);
        if (!sample) continue;
        sample->frame = static_cast<int>(k);
        common.samples.push_back(std::move(*sample));
        break;
      }
    }
    if (!common.samples.empty()) out.tracks.push_back(std::move(common));
  }
  return out;
}

}  // namespace kinescope
