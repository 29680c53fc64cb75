// SPDX-License-Identifier: Apache-2.0
#include "app/explain/first_look.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/explain/declared.h"
#include "app/explain/moving_camera.h"
#include "kinematics/core/error.h"
#include "kinematics/log/log_faults.h"
#include "kinematics/log/readings_apart.h"
#include "kinematics/structure/flange_log.h"

namespace kinescope {
namespace {

std::optional<Structure> structure_of(const Recording& recording, const PoseTracks& tracks,
                                      const JointLog& log, const CalibrateOptions& options) {
  StructureOptions structure_options;
  structure_options.scan_time_offset = options.estimate_time_offset;
  if (!log.empty()) structure_options.units = declared_units(recording);
  structure_options.camera_on_robot = recording.settings.camera_mount == CameraMount::kOnHand;
  try {
    return find_structure(tracks, log, structure_options);
  } catch (const Error&) {
    return std::nullopt;  // said where the structure is asked for
  }
}

bool is_robot(const Structure& structure) {
  return structure.status == StructureStatus::kDetermined && structure.free_markers.empty() &&
         !structure.joints.empty();
}

// Another reading of a pose's columns.
struct Convention {
  const char* words;
  Pose (*read)(const Pose& pose);
};

Pose w_first(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  return {Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w()), pose.translation};
}

Pose conjugated(const Pose& pose) { return {pose.rotation.conjugate(), pose.translation}; }

Pose inverted(const Pose& pose) { return pose.inverse(); }

Pose w_first_inverted(const Pose& pose) { return w_first(pose).inverse(); }

constexpr std::array<Convention, 4> kConventions{
    {{"with the poses inverted (of the camera in the body's frame)", inverted},
     {"with the quaternions in the order w, x, y, z", w_first},
     {"with the quaternions conjugated", conjugated},
     {"with the quaternions in the order w, x, y, z and the poses inverted", w_first_inverted}}};

std::string names_of(const std::vector<int>& channels, const JointLog& log) {
  std::vector<std::string> names;
  for (const int channel : channels)
    names.push_back(fmt::format("'{}'", log.channels[static_cast<std::size_t>(channel)]));
  return fmt::format("{}", fmt::join(names, ", "));
}

void refuse_flange_poses(const JointLog& log, const PoseTracks& tracks,
                         const CalibrateOptions& options) {
  constexpr double kLargestOffsetS = 1.0;  // by which they may be apart
  const auto flange =
      flange_columns(tracks, log, options.estimate_time_offset ? kLargestOffsetS : 0.0);
  if (!flange) return;
  throw undetermined(
      log.source,
      fmt::format(
          "{} ({}) beside {} are poses, not joint values: tag_{} turns from frame to frame "
          "as they say, to {:.2g} deg{}",
          names_of(flange->rotation, log), flange->convention, names_of(flange->position, log),
          flange->marker.value, flange->misfit_rad * 180.0 / std::numbers::pi,
          flange->inverted ? ", where the camera is on the hand, or they are of the base in "
                             "the flange's frame"
                           : ""),
      "log the values of the joints; to calibrate the camera to the hand by these poses, name the "
      "file flange.csv, with the columns t, x, y, z, qx, qy, qz, qw");
}

std::string csv_of(const Recording& recording, std::string_view entry) {
  return (recording.folder / fmt::format("{}.csv", entry)).string();
}

void refuse_other_convention(const Recording& recording, const PoseTracks& tracks,
                             const CalibrateOptions& options) {
  constexpr std::size_t kFrames = 100;  // enough, and what is no robot takes long to search
  const int every = std::max(1, static_cast<int>(tracks.times_s.size() / kFrames));
  std::vector<std::string> fitting;  // of few joints several may
  for (const Convention& convention : kConventions) {
    PoseTracks read = tracks;
    for (PoseTrack& track : read.tracks) {
      std::erase_if(track.samples,
                    [&](const PoseSample& sample) { return sample.frame % every != 0; });
      for (PoseSample& sample : track.samples) {
        sample.T_camera_marker = convention.read(sample.T_camera_marker);
      }
    }
    const auto structure = structure_of(recording, read, recording.log, options);
    if (structure && is_robot(*structure)) fitting.emplace_back(convention.words);
  }
  if (fitting.empty()) return;
  throw undetermined(
      csv_of(recording, "poses"),
      fmt::format("the bodies do not move as a robot's links do, but {} they do",
                  fmt::join(fitting, ", or ")),
      fmt::format("qx, qy, qz, qw and x, y, z are the pose of the body in the "
                  "tracker's frame: convert the table{}",
                  fitting.size() == 1 ? ""
                                      : "; which way, or whether it is right as it "
                                        "is, the robot's drawing (--nominal) tells"));
}

std::string idle_channels(const Structure& structure, const JointLog& log) {
  constexpr std::size_t kMost = 6;
  std::vector<std::string> names;
  for (const int channel : structure.idle_channels) {
    if (names.size() == kMost) break;
    names.push_back(fmt::format("'{}'", log.channels[static_cast<std::size_t>(channel)]));
  }
  const std::size_t more = structure.idle_channels.size() - names.size();
  return fmt::format("{}{}", fmt::join(names, ", "),
                     more > 0 ? fmt::format(" and {} more", more) : "");
}

bool is_driven(const Structure& structure) {
  return std::ranges::any_of(structure.joints,
                             [](const StructureJoint& joint) { return joint.channel.has_value(); });
}

bool covers_half(const std::vector<double>& times_s, const JointLog& log) {
  return 2.0 * (times_s.back() - times_s.front()) > log.times_s.back() - log.times_s.front();
}

// One channel that drives nothing may be anything; a log of several is of joints.
constexpr std::size_t kFewestIdle = 2;

// Frames from `first` to before `last`.
PoseTracks part_of(const PoseTracks& tracks, std::size_t first, std::size_t last) {
  PoseTracks out = tracks;
  for (PoseTrack& track : out.tracks) {
    std::erase_if(track.samples, [&](const PoseSample& sample) {
      const auto frame = static_cast<std::size_t>(sample.frame);
      return frame < first || frame >= last;
    });
  }
  return out;
}

// Over so few frames one channel may go with one joint by chance, most of them with most do not.
bool is_mostly_driven(const Structure& structure) {
  const auto driven = std::ranges::count_if(
      structure.joints, [](const StructureJoint& joint) { return joint.channel.has_value(); });
  return is_robot(structure) && 2 * driven > std::ssize(structure.joints);
}

// Without single readings that no other comes near, without stretches in which the log repeats one
// row, or in a half of the recording: a log that jumps once, is frozen or goes wrong halfway is
// this recording's all the same.
bool is_driven_in_part(const Recording& recording, const PoseTracks& tracks,
                       const CalibrateOptions& options) {
  const std::vector<ReadingApart> apart = readings_apart(recording.log);
  const JointLog near = without_readings(recording.log, apart);
  const std::vector<RepeatedStretch> frozen = repeated_stretches(near, kMaxGap);
  const JointLog moving = without_stretches(near, frozen);
  if (!apart.empty() || !frozen.empty()) {
    const auto whole = structure_of(recording, tracks, moving, options);
    if (!whole || is_driven(*whole)) return true;
  }
  const std::size_t frames = tracks.times_s.size();
  const auto in_half = [&](std::size_t first, std::size_t last) {
    const auto half = structure_of(recording, part_of(tracks, first, last), moving, options);
    return half && is_mostly_driven(*half);
  };
  return in_half(0, frames / 2) || in_half(frames / 2, frames);
}

void refuse_other_log(const Recording& recording, const PoseTracks& tracks, const Structure& alone,
                      const std::string& idle, const CalibrateOptions& options) {
  if (!is_robot(alone) || is_driven_in_part(recording, tracks, options)) return;
  throw undetermined(
      recording.log.source,
      fmt::format("the markers move as a robot of {} joint{} does, and no column of the log moves "
                  "with them ({})",
                  alone.joints.size(), alone.joints.size() == 1 ? "" : "s", idle),
      "is it the log of this recording, with stamps on the same clock to a second? Without a log "
      "structure and joint values are found from the markers alone");
}

void refuse_markers_at_rest(const Recording& recording, const PoseTracks& tracks,
                            const Structure& alone, const std::string& idle) {
  if (!alone.joints.empty() || !alone.free_markers.empty()) return;
  if (!covers_half(tracks.times_s, recording.log)) return;
  throw undetermined(recording.log.source,
                     fmt::format("{} move, and no marker does clear of its noise", idle),
                     "is it the log of this recording? Record the markers while every joint moves");
}

}  // namespace

std::optional<Structure> require_plausible_motion(const Recording& recording,
                                                  const PoseTracks& tracks,
                                                  const CalibrateOptions& options) {
  if (recording.nominal || tracks.tracks.empty() || tracks.times_s.size() < 2) return std::nullopt;
  const JointLog& log = recording.log;
  refuse_flange_poses(log, tracks, options);
  auto first = structure_of(recording, tracks, log, options);
  if (first && !is_robot(*first)) {
    const bool idle = first->idle_channels.size() >= kFewestIdle && !is_driven(*first);
    const auto alone = idle ? structure_of(recording, tracks, {}, options) : std::nullopt;
    if (alone) refuse_markers_at_rest(recording, tracks, *alone, idle_channels(*first, log));
    if (recording.entry == RecordingEntry::kPoses) {
      refuse_other_convention(recording, tracks, options);
    }
    if (alone) refuse_other_log(recording, tracks, *alone, idle_channels(*first, log), options);
  }
  if (moves_camera(recording)) first.reset();
  return first;
}

}  // namespace kinescope
