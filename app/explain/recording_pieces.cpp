// SPDX-License-Identifier: Apache-2.0
#include "app/explain/recording_pieces.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "calib/tracks/pose_tracks_from_tags.h"
#include "kinematics/core/error.h"
#include "kinematics/log/join_logs.h"

namespace kinescope {
namespace {

void append_frames(TagObservations& all, TagObservations more) {
  const auto before = static_cast<int>(all.times_s.size());
  all.times_s.insert(all.times_s.end(), more.times_s.begin(), more.times_s.end());
  for (TagObservation& tag : more.observations) {
    tag.frame += before;
    all.observations.push_back(std::move(tag));
  }
  for (RejectedTag& tag : more.rejected) {
    tag.frame += before;
    all.rejected.push_back(std::move(tag));
  }
}

PoseTracks appended(const PoseTracks& first, PoseTracks second) {
  const auto before = static_cast<int>(first.times_s.size());
  for (PoseTrack& track : second.tracks)
    for (PoseSample& sample : track.samples) sample.frame += before;
  std::vector<double> times_s = first.times_s;
  times_s.insert(times_s.end(), second.times_s.begin(), second.times_s.end());
  return merged({first, second}, std::move(times_s));
}

}  // namespace

std::set<TagId> ids_of(const LoneCamera& of) {
  std::set<TagId> out;
  const Measurements& seen = of.seen.observed.measurements;
  for (const TagObservation& tag : seen.corners) out.insert(tag.id);
  for (const PoseTrack& track : seen.poses.tracks) out.insert(track.id);
  for (const PointObservation& point : seen.points.observations) out.insert(point.id);
  return out;
}

void rename_marker(TagId from, TagId to, LoneCamera& of) {
  const auto rename = [&](auto& seen) {
    for (auto& one : seen)
      if (one.id == from) one.id = to;
  };
  Observed& observed = of.seen.observed;
  rename(observed.tags.observations);
  rename(observed.tags.rejected);
  rename(observed.measurements.corners);
  rename(observed.measurements.poses.tracks);
  rename(observed.measurements.points.observations);
  rename(of.tracks.tracks);
  std::ranges::sort(of.tracks.tracks, {}, &PoseTrack::id);
  std::ranges::sort(observed.measurements.poses.tracks, {}, &PoseTrack::id);
  MarkerSet& markers = of.recording.markers;
  if (const double size = markers.size_m(from); size > 0.0) markers.sizes_m[to] = size;
  if (const auto board = markers.boards.find(from); board != markers.boards.end())
    markers.boards.insert_or_assign(to, std::vector(board->second));
}

std::pair<double, double> span_of(const LoneCamera& of) {
  const std::vector<double>& log = of.recording.log.times_s;
  const std::vector<double>& frames = of.seen.observed.measurements.times_s;
  if (frames.empty()) return {log.front(), log.back()};
  return {std::min(log.front(), frames.front()), std::max(log.back(), frames.back())};
}

bool is_of_postures(const JointLog& log, const std::vector<double>& times_s) {
  std::vector<int> channels(log.channels.size());
  std::iota(channels.begin(), channels.end(), 0);
  return is_posture_log(log, times_s, channels);
}

bool is_of_postures(const LoneCamera& of) {
  return is_of_postures(of.recording.log, of.seen.observed.measurements.times_s);
}

void require_one_kind(const std::vector<LoneCamera>& alone) {
  const bool postures = is_of_postures(alone.front());
  for (const LoneCamera& one : alone) {
    if (is_of_postures(one) == postures) continue;
    throw bad_request(
        one.recording.folder.string(),
        fmt::format("it holds {}, {} {}", postures ? "motion" : "postures at rest",
                    alone.front().recording.camera_name, postures ? "postures at rest" : "motion"),
        "combine recordings of one kind");
  }
}

bool may_go_on(const LoneCamera& first, const LoneCamera& second) {
  const auto& a = first.recording;
  const auto& b = second.recording;
  return b.log.times_s.front() > a.log.times_s.back() &&
         span_of(second).first > span_of(first).second && a.camera == b.camera;
}

LoneCamera pieces_together(const LoneCamera& first, const LoneCamera& second) {
  LoneCamera out = first;
  out.recording.camera_name += "+" + second.recording.camera_name;
  out.recording.video.clear();
  out.recording.log = joined_logs(out.recording.log, second.recording.log, 0.0, false);
  Measurements& seen = out.seen.observed.measurements;
  const Measurements& more = second.seen.observed.measurements;
  const auto before = static_cast<int>(seen.times_s.size());
  seen.times_s.insert(seen.times_s.end(), more.times_s.begin(), more.times_s.end());
  seen.poses = appended(seen.poses, more.poses);
  if (seen.poses.tracks.empty()) seen.poses = {};
  for (PointObservation point : more.points.observations) {
    point.frame += before;
    seen.points.observations.push_back(std::move(point));
  }
  if (!seen.points.observations.empty()) seen.points.times_s = seen.times_s;
  append_frames(out.seen.observed.tags, second.seen.observed.tags);
  seen.corners = out.seen.observed.tags.observations;
  out.tracks =
      out.seen.observed.tags.observations.empty()
          ? seen.poses
          : pose_tracks_from_tags(out.seen.observed.tags, out.seen.camera, out.recording.markers);
  for (const std::string& warning : second.seen.observed.warnings)
    out.seen.observed.warnings.push_back(warning);
  return out;
}

}  // namespace kinescope
