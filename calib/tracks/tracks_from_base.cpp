// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/tracks_from_base.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

using SamplesByFrame = std::map<int, const PoseSample*>;

SamplesByFrame by_frame(const PoseTracks& tracks, TagId id) {
  SamplesByFrame out;
  const auto track = std::ranges::find(tracks.tracks, id, &PoseTrack::id);
  if (track == tracks.tracks.end()) return out;
  for (const PoseSample& sample : track->samples) out.emplace(sample.frame, &sample);
  return out;
}

// Component by component about the middle one: views of the wrong planar branch do not matter.
Pose median_of_poses(const std::vector<Pose>& poses) {
  Pose out = poses[poses.size() / 2];
  for (int round = 0; round < 2; ++round) {
    std::array<std::vector<double>, 6> moves;
    for (const Pose& pose : poses) {
      const Vector6d d = log_pose(out.inverse() * pose);
      for (std::size_t i = 0; i < 6; ++i) moves[i].push_back(d[static_cast<Eigen::Index>(i)]);
    }
    Vector6d middle;
    for (std::size_t i = 0; i < 6; ++i) middle[static_cast<Eigen::Index>(i)] = median_of(moves[i]);
    out = out * exp_pose(middle);
  }
  return out;
}

// Frames in which each two of the base markers are seen together.
struct SeenTogetherPair {
  std::size_t a = 0, b = 0;
  std::vector<Pose> T_a_b;
};

std::vector<SeenTogetherPair> pairs_of(const std::vector<SamplesByFrame>& seen) {
  std::vector<SeenTogetherPair> out;
  for (std::size_t a = 0; a < seen.size(); ++a) {
    for (std::size_t b = a + 1; b < seen.size(); ++b) {
      SeenTogetherPair pair{a, b, {}};
      for (const auto& [frame, sample] : seen[a]) {
        const auto other = seen[b].find(frame);
        if (other == seen[b].end()) continue;
        pair.T_a_b.push_back(sample->T_camera_marker.inverse() * other->second->T_camera_marker);
      }
      if (!pair.T_a_b.empty()) out.push_back(std::move(pair));
    }
  }
  std::ranges::stable_sort(out, std::ranges::greater{},
                           [](const SeenTogetherPair& pair) { return pair.T_a_b.size(); });
  return out;
}

// T_first_marker of each; nothing where no chain of pairs leads there.
std::vector<std::optional<Pose>> map_of(const std::vector<SamplesByFrame>& seen) {
  std::vector<std::optional<Pose>> out(seen.size());
  out.front() = Pose{};
  const std::vector<SeenTogetherPair> pairs = pairs_of(seen);
  // Prim's algorithm: the pair seen most that leads on.
  for (bool grown = true; grown;) {
    grown = false;
    for (const SeenTogetherPair& pair : pairs) {
      if (out[pair.a].has_value() == out[pair.b].has_value()) continue;
      const Pose T_a_b = median_of_poses(pair.T_a_b);
      if (out[pair.a]) {
        out[pair.b] = *out[pair.a] * T_a_b;
      } else {
        out[pair.a] = *out[pair.b] * T_a_b.inverse();
      }
      grown = true;
      break;
    }
  }
  return out;
}

// Of one marker: T_camera_base, and its covariance.
CameraPose told_by(const PoseSample& sample, const Pose& T_base_marker) {
  const Matrix6d A = adjoint(T_base_marker);
  return {sample.T_camera_marker * T_base_marker.inverse(), A * sample.covariance * A.transpose()};
}

// One step of least squares from the most certain: what each says of it is near.
CameraPose fused(const std::vector<CameraPose>& told) {
  const auto best = std::ranges::min_element(
      told, {}, [](const CameraPose& pose) { return pose.covariance.trace(); });
  if (told.size() == 1) return *best;
  constexpr double kFar = 5.0;  // standard deviations: of the wrong planar branch
  Matrix6d information = Matrix6d::Zero();
  Vector6d right = Vector6d::Zero();
  for (const CameraPose& pose : told) {
    const Vector6d d = log_pose(best->T_camera_base.inverse() * pose.T_camera_base);
    const Matrix6d W = pose.covariance.inverse();
    if (d.dot((pose.covariance + best->covariance).inverse() * d) > 6.0 * kFar * kFar) continue;
    information += W;
    right += W * d;
  }
  const Matrix6d covariance = information.inverse();
  return {best->T_camera_base * exp_pose(covariance * right), covariance};
}

// T_base_marker of a sample, with what the camera's pose adds to its covariance.
PoseSample seen_from_base(const PoseSample& sample, const CameraPose& camera) {
  PoseSample out = sample;
  const Pose T_base_camera = camera.T_camera_base.inverse();
  out.T_camera_marker = T_base_camera * sample.T_camera_marker;
  const Matrix6d A = adjoint(out.T_camera_marker.inverse());
  out.covariance += A * camera.covariance * A.transpose();
  if (!sample.T_camera_marker_alternative) return out;
  out.T_camera_marker_alternative = T_base_camera * *sample.T_camera_marker_alternative;
  if (sample.alternative_covariance) {
    const Matrix6d B = adjoint(out.T_camera_marker_alternative->inverse());
    *out.alternative_covariance += B * camera.covariance * B.transpose();
  }
  return out;
}

}  // namespace

BaseView tracks_from_base(const PoseTracks& tracks, std::span<const TagId> base) {
  KINESCOPE_CHECK(!base.empty(), "a base has a marker");
  std::vector<SamplesByFrame> seen;
  for (const TagId id : base) seen.push_back(by_frame(tracks, id));
  const std::vector<std::optional<Pose>> map = map_of(seen);
  BaseView out;
  std::vector<std::vector<CameraPose>> told(tracks.times_s.size());
  for (std::size_t k = 0; k < seen.size(); ++k) {
    if (!map[k]) continue;
    out.markers.push_back(base[k]);
    out.T_base_marker.push_back(*map[k]);
    for (const auto& [frame, sample] : seen[k])
      told[static_cast<std::size_t>(frame)].push_back(told_by(*sample, *map[k]));
  }
  for (const std::vector<CameraPose>& frame : told)
    out.cameras.push_back(frame.empty() ? std::nullopt : std::optional(fused(frame)));
  out.others.times_s = tracks.times_s;
  for (const PoseTrack& track : tracks.tracks) {
    if (std::ranges::find(base, track.id) != base.end()) continue;
    PoseTrack& from_base = out.others.tracks.emplace_back(PoseTrack{track.id, {}});
    for (const PoseSample& sample : track.samples) {
      const auto& camera = out.cameras[static_cast<std::size_t>(sample.frame)];
      if (camera) from_base.samples.push_back(seen_from_base(sample, *camera));
    }
  }
  std::erase_if(out.others.tracks, [](const PoseTrack& track) { return track.samples.empty(); });
  return out;
}

}  // namespace kinescope
