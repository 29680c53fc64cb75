// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/interpolated_track.h"

#include <algorithm>
#include <utility>

namespace kinescope::tracks {
namespace {

// Stamps closer than this are one: what printing to nanoseconds leaves.
constexpr double kSameS = 1e-8;

Pose between(const Pose& a, const Pose& b, double share) {
  return a * exp_pose(share * log_pose(a.inverse() * b));
}

}  // namespace

InterpolatedTrack::InterpolatedTrack(std::vector<double> times_s,
                                     std::vector<const PoseSample*> samples, double bridge_s)
    : times_s_(std::move(times_s)), samples_(std::move(samples)), bridge_s_(bridge_s) {}

std::optional<PoseSample> InterpolatedTrack::at(double time_s) const {
  const auto next = std::ranges::lower_bound(times_s_, time_s - kSameS);
  if (next == times_s_.end()) return std::nullopt;
  const auto k = static_cast<std::size_t>(next - times_s_.begin());
  PoseSample out = *samples_[k];
  out.frame = 0;
  if (*next <= time_s + kSameS) return out;
  if (k == 0 || *next - times_s_[k - 1] > bridge_s_) return std::nullopt;
  const PoseSample& before = *samples_[k - 1];
  const double share = (time_s - times_s_[k - 1]) / (*next - times_s_[k - 1]);
  out.T_camera_marker = between(before.T_camera_marker, samples_[k]->T_camera_marker, share);
  out.covariance =
      (1.0 - share) * (1.0 - share) * before.covariance + share * share * samples_[k]->covariance;
  const bool both = before.T_camera_marker_alternative && out.T_camera_marker_alternative;
  out.alternative_covariance.reset();
  if (!both) {
    out.T_camera_marker_alternative.reset();
    out.alternative_cost = 0.0;
    return out;
  }
  out.T_camera_marker_alternative =
      between(*before.T_camera_marker_alternative, *out.T_camera_marker_alternative, share);
  out.alternative_cost =
      (1.0 - share) * before.alternative_cost + share * samples_[k]->alternative_cost;
  return out;
}

bool are_simultaneous(const std::vector<double>& times_s, const std::vector<double>& others_s) {
  const auto same = std::ranges::count_if(times_s, [&](double t) {
    const auto next = std::ranges::lower_bound(others_s, t - kSameS);
    return next != others_s.end() && *next <= t + kSameS;
  });
  return 2 * same > std::ssize(times_s);
}

}  // namespace kinescope::tracks
