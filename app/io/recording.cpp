// SPDX-License-Identifier: Apache-2.0
#include "app/io/recording.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/bag_files.h"
#include "app/io/nearest_name.h"
#include "app/io/recording_doubts.h"
#include "app/io/recording_files.h"
#include "calib/camera/camera_file.h"
#include "kinematics/core/bad_rows.h"
#include "kinematics/core/error.h"
#include "kinematics/core/mean_step.h"
#include "kinematics/recorded/container.h"
#include "kinematics/recorded/recorded_log.h"
#include "kinematics/urdf/urdf.h"

namespace kinescope {
namespace fs = std::filesystem;
namespace {

/// Brings a channel to SI. Ticks stay: their scale is found from the motion.
void convert_channel(JointLog& log, int channel, std::string& unit) {
  if (unit != "deg" && unit != "mm") return;
  const bool turns = unit == "deg";
  const double factor = turns ? std::numbers::pi / 180.0 : 1e-3;
  log.values.col(channel) *= factor;
  log.unit_factors[log.channels[static_cast<std::size_t>(channel)]] = factor;
  unit = turns ? "rad" : "m";
}

void convert_units(JointLog& log, RecordingSettings& settings, const fs::path& settings_file) {
  std::map<std::string, std::string> by_channel;  // a name may have been written with its unit
  for (auto& [name, unit] : settings.units) {
    const std::optional<int> channel = log.channel(name);
    if (!channel) {
      throw bad_input(settings_file.string(),
                      fmt::format("units names a channel '{}' that is not logged", name),
                      did_you_mean(name, log.channels));
    }
    convert_channel(log, *channel, unit);
    by_channel[log.channels[static_cast<std::size_t>(*channel)]] = unit;
  }
  settings.units = std::move(by_channel);
}

/// Where a nominal robot stands can be seen without a log only when nothing of it moves.
void require_no_joints(const KinematicTree& nominal, const fs::path& folder) {
  std::vector<std::string> names;
  for (const Joint& joint : nominal.joints) {
    if (is_movable(joint)) names.push_back(joint.name);
  }
  if (names.empty()) return;
  throw bad_input((folder / "joints.csv").string(),
                  "no such file, but the nominal robot has joints",
                  fmt::format("add it with the columns t, {}", fmt::join(names, ", ")));
}

/// Pixels that are not square are of few cameras; a slip of the pen makes them, too.
void warn_of_pixels(const CameraModel& camera, const fs::path& file,
                    std::vector<std::string>& warnings) {
  constexpr double kSquare = 1.1;
  const double ratio = std::max(camera.fx, camera.fy) / std::min(camera.fx, camera.fy);
  if (ratio <= kSquare) return;
  warnings.push_back(
      fmt::format("{}: fx = {:.6g} and fy = {:.6g} are of pixels {:.3g} times as long as wide: is "
                  "one of them wrong?",
                  file.string(), camera.fx, camera.fy, ratio));
}

/// Sizes of one robot's markers that lie this far apart are in two units, mostly.
void warn_of_sizes(const MarkerSet& markers, const fs::path& file,
                   std::vector<std::string>& warnings) {
  constexpr double kFarApart = 8.0;
  double least = markers.default_size_m > 0.0 ? markers.default_size_m : 1e9;
  double most = std::max(0.0, markers.default_size_m);
  for (const auto& [id, size] : markers.sizes_m) {
    least = std::min(least, size);
    most = std::max(most, size);
  }
  if (most <= kFarApart * least) return;
  warnings.push_back(fmt::format("{}: sizes from {:g} to {:g} m: are all of them in m?",
                                 file.string(), least, most));
}

/// A robot with links of tens of metres is drawn in mm.
void require_metres(const KinematicTree& nominal, const fs::path& file) {
  constexpr double kNoLinkM = 20.0;
  for (const Joint& joint : nominal.joints) {
    const double apart = joint.T_parent_joint.translation.norm();
    if (apart <= kNoLinkM) continue;
    throw bad_input(
        file.string(),
        fmt::format("joint '{}' lies {:.4g} m from the joint before it: in mm?", joint.name, apart),
        "lengths of a URDF are in m: divide them by 1000");
  }
}

/// Torque channels that are declared must be columns, or the declaration is a slip of the pen.
void read_log(Recording& recording, const RecordingFiles& files) {
  if (!files.joints) {
    if (!recording.settings.units.empty()) {
      throw bad_input(value_of(files.settings).string(),
                      "units are declared, but there is no joints.csv",
                      "add it, or remove the units");
    }
    if (recording.nominal) require_no_joints(*recording.nominal, recording.folder);
    return;
  }
  RecordingSettings& settings = recording.settings;
  recording.log = recorded::read_joint_log(*files.joints, settings.torque_channels);
  recording.warnings.insert(recording.warnings.end(), recording.log.warnings.begin(),
                            recording.log.warnings.end());
  if (!settings.torque_channels.empty()) {
    const JointLog all = recorded::read_joint_log(*files.joints);
    for (const std::string& name : settings.torque_channels) {
      if (name.starts_with("tau") || all.channel(name)) continue;
      throw bad_input(value_of(files.settings).string(),
                      fmt::format("torques names '{}', which is not logged", name),
                      did_you_mean(name, all.channels));
    }
  }
  if (!settings.units.empty()) convert_units(recording.log, settings, value_of(files.settings));
}

void read_flange_poses(Recording& recording, const RecordingFiles& files) {
  if (!files.flange) return;
  ReadSightings<std::vector<FlangeReading>> read =
      read_flange(*files.flange, recording.settings.flange);
  recording.flange = std::move(read.found);
  recording.warnings.insert(recording.warnings.end(), read.warnings.begin(), read.warnings.end());
}

/// Distances join targets that hold a point.
void add_distances(Recording& recording, const RecordingFiles& files) {
  std::vector<std::string> targets;
  for (const PointObservation& point : value_of(recording.points).observations) {
    if (!point.target.empty()) targets.push_back(point.target);
  }
  std::ranges::sort(targets);
  const auto repeated = std::ranges::unique(targets);
  targets.erase(repeated.begin(), repeated.end());
  for (const TargetDistance& distance : recording.settings.target_distances) {
    for (const std::string& name : {distance.from, distance.to}) {
      if (std::ranges::binary_search(targets, name)) continue;
      throw bad_input(value_of(files.settings).string(),
                      fmt::format("target_distances names '{}', which holds no point", name),
                      did_you_mean(name, targets));
    }
  }
  value_of(recording.points).distances = recording.settings.target_distances;
}

/// Stamps of tables are on the log's clock already; a start beside them is one too many.
void refuse_video_start(const Recording& recording, const RecordingFiles& files) {
  const RecordingSettings& settings = recording.settings;
  if (recording.entry == RecordingEntry::kVideo ||
      (settings.video_start_s == 0.0 && settings.video_starts_s.empty()))
    return;
  throw bad_input(value_of(files.settings).string(),
                  fmt::format("video_start is {} s, but the recording is read from {}.csv, whose t "
                              "is on the log's clock",
                              recording.settings.video_start_s, to_string(recording.entry)),
                  "remove video_start, or add it to the column t");
}

/// A corner outside the image, if there is one. A corner is extrapolated from the marker's edges,
/// so that it may lie a little outside: by 1 % of the size.
std::optional<Eigen::Vector2d> corner_outside(const TagObservation& tag,
                                              const CameraModel& camera) {
  constexpr double kSlack = 0.01;
  const Eigen::Vector2d size(camera.width, camera.height);
  for (const Eigen::Vector2d& corner : tag.corners_px) {
    const bool inside = (corner.array() >= -kSlack * size.array()).all() &&
                        (corner.array() <= (1.0 + kSlack) * size.array()).all();
    if (!inside) return corner;
  }
  return std::nullopt;
}

/// Columns that hold each other's coordinate: many corners are outside the image, and all of them
/// inside once u and v are exchanged. Seen only where the image is not square.
void refuse_exchanged_axes(const TagObservations& corners, const CameraModel& camera,
                           const fs::path& file) {
  constexpr double kMany = 0.05;
  CameraModel turned = camera;
  std::swap(turned.width, turned.height);
  std::size_t outside = 0;
  for (const TagObservation& tag : corners.observations) {
    if (corner_outside(tag, turned)) return;
    if (corner_outside(tag, camera)) ++outside;
  }
  const std::size_t all = corners.observations.size();
  if (static_cast<double>(outside) < kMany * static_cast<double>(all)) return;
  throw bad_input(file.string(),
                  fmt::format("{} of {} sightings are outside images of {} x {} px, and none is "
                              "with u and v exchanged",
                              outside, all, camera.width, camera.height),
                  "u counts to the right, v down: exchange the two columns, or give the intrinsics "
                  "of the images that the corners were found in");
}

/// All corners within a pixel or two: they are shares of the image's size, or of another unit.
void refuse_normalised(const TagObservations& corners, const CameraModel& camera,
                       const fs::path& file) {
  double farthest = 0.0;
  for (const TagObservation& tag : corners.observations) {
    for (const Eigen::Vector2d& corner : tag.corners_px) {
      farthest = std::max(farthest, corner.cwiseAbs().maxCoeff());
    }
  }
  constexpr double kShare = 2.0;
  if (farthest > kShare) return;
  throw bad_input(file.string(),
                  fmt::format("no corner is farther than {:.3g} px from the first pixel, in images "
                              "of {} x {} px: are these shares of the size?",
                              farthest, camera.width, camera.height),
                  "give u and v in pixels: times the width and the height");
}

/// Leaves a few markers outside the images out; more of them are of other images than the camera's.
void leave_out_outside(TagObservations& corners, const CameraModel& camera,
                       const CameraFiles& files, std::vector<std::string>& warnings) {
  if (camera.width <= 0 || camera.height <= 0) return;  // its file tells no size
  refuse_exchanged_axes(corners, camera, value_of(files.corners));
  BadRows bad(value_of(files.corners).string(), corners.observations.size(), "sightings");
  std::vector<TagObservation> inside;
  for (TagObservation& tag : corners.observations) {
    const auto corner = corner_outside(tag, camera);
    if (!corner) {
      inside.push_back(std::move(tag));
      continue;
    }
    bad.add(
        bad.size(),
        bad_input(value_of(files.corners).string(),
                  fmt::format("tag {} at t = {} has a corner at ({:.1f}, {:.1f}), outside the "
                              "images of {} x {} px of {}",
                              tag.id.value, corners.times_s[static_cast<std::size_t>(tag.frame)],
                              corner->x(), corner->y(), camera.width, camera.height,
                              value_of(files.camera).string()),
                  "give the intrinsics of the images that the corners were found in"));
  }
  corners.observations = std::move(inside);
  const std::vector<std::string> left_out = bad.warnings();
  warnings.insert(warnings.end(), left_out.begin(), left_out.end());
}

void take_image_size(const fs::path& folder, const CameraFiles& files,
                     const std::optional<CameraModel>& camera, TagObservations& corners,
                     std::vector<std::string>& warnings) {
  if (!files.camera) {
    const std::string name =
        files.name.empty() ? "camera.yaml" : fmt::format("camera_{}.yaml", files.name);
    throw bad_input((folder / name).string(),
                    fmt::format("no such file, and {} does not say how large the images were",
                                value_of(files.corners).filename().string()),
                    files.name.empty() ? "add the camera's intrinsics, or name them with --camera"
                                       : "add the camera's intrinsics");
  }
  if (!camera) return;  // it was refused
  corners.width = camera->width;
  corners.height = camera->height;
  refuse_normalised(corners, *camera, value_of(files.corners));
  leave_out_outside(corners, *camera, files, warnings);
}

/// One camera's table of corners.
TagObservations read_corners_of(const Recording& recording, const CameraFiles& files,
                                const std::optional<CameraModel>& camera,
                                std::vector<std::string>& warnings) {
  TagObservations out = read_corners(value_of(files.corners), recording.markers);
  const std::vector<std::string> said = std::exchange(out.warnings, {});
  warnings.insert(warnings.end(), said.begin(), said.end());
  take_image_size(recording.folder, files, camera, out, warnings);
  turn_clockwise_corners(out, recording.markers, value_of(files.corners), warnings);
  require_time_overlap(recording.log, out.times_s, value_of(files.corners).string());
  return out;
}

std::optional<CameraModel> read_intrinsics(const fs::path& file,
                                           std::vector<std::string>& warnings) {
  const auto bag = bags::bag_source(file);
  std::optional<CameraModel> camera = bag ? camera_of_bag(*bag) : read_camera(file);
  if (!camera) return camera;
  warn_of_pixels(*camera, file, warnings);
  warn_of_principal_point(*camera, file, warnings);
  return camera;
}

void read_cameras(Recording& recording, const RecordingFiles& files) {
  for (const CameraFiles& one : files.cameras) {
    RecordedCamera& camera = recording.cameras.emplace_back();
    camera.name = one.name;
    if (one.camera) {
      camera.camera = read_intrinsics(*one.camera, recording.warnings);
      camera.camera_file = *one.camera;
    }
    if (one.video) camera.video = *one.video;
    if (one.corners)
      camera.corners = read_corners_of(recording, one, camera.camera, recording.warnings);
  }
}

/// What only one camera, or only a log, makes possible.
void check_cameras(const Recording& recording, const RecordingFiles& files) {
  std::vector<std::string> names;
  for (const CameraFiles& camera : files.cameras) names.push_back(camera.name);
  const RecordingSettings& settings = recording.settings;
  const auto refuse = [&](const std::string& what, const std::string& remedy) {
    throw bad_input(value_of(files.settings).string(), what, remedy);
  };
  const auto require_name = [&](const char* key, const std::string& name) {
    if (std::ranges::find(names, name) != names.end()) return;
    refuse(fmt::format("{} names a camera '{}', and there is none of that name", key, name),
           names.empty() ? "the recording is of one camera: remove it" : did_you_mean(name, names));
  };
  for (const auto& [name, start_s] : settings.video_starts_s) require_name("video_start", name);
  if (!settings.gravity_camera.empty()) require_name("gravity_camera", settings.gravity_camera);
  if (names.empty()) return;
  if (settings.gravity && settings.gravity_camera.empty()) {
    refuse("gravity is declared in a camera's frame, and there are several cameras",
           fmt::format("add gravity_camera: {}", names.front()));
  }
  if (files.flange) {
    throw bad_input(files.flange->string(), "calibrates one camera, and there are several",
                    "name one with --video or --corners, and its intrinsics with --camera");
  }
  if (files.joints) return;
  throw bad_input((recording.folder / "joints.csv").string(),
                  "no such file, and the clocks of several cameras are tied by the joint log",
                  "add it, or name one camera with --video or --corners");
}

void read_sightings(Recording& recording, const RecordingFiles& files) {
  const auto warn = [&](const std::vector<std::string>& warnings) {
    recording.warnings.insert(recording.warnings.end(), warnings.begin(), warnings.end());
  };
  refuse_video_start(recording, files);
  if (!files.cameras.empty()) return read_cameras(recording, files);
  switch (recording.entry) {
    case RecordingEntry::kVideo:
      recording.video = value_of(files.video);
      break;
    case RecordingEntry::kCorners:
      recording.corners =
          read_corners_of(recording, {"", std::nullopt, files.corners, files.camera},
                          recording.camera, recording.warnings);
      break;
    case RecordingEntry::kPoses: {
      ReadSightings<PoseTracks> read = read_poses(value_of(files.poses));
      recording.poses = std::move(read.found);
      warn(read.warnings);
      require_time_overlap(recording.log, value_of(recording.poses).times_s,
                           value_of(files.poses).string());
      break;
    }
    case RecordingEntry::kPoints: {
      ReadSightings<PointObservations> read = read_points(value_of(files.points));
      recording.points = std::move(read.found);
      warn(read.warnings);
      add_distances(recording, files);
      require_time_overlap(recording.log, value_of(recording.points).times_s,
                           value_of(files.points).string());
      break;
    }
  }
}

void read_markers(Recording& recording, const RecordingFiles& files) {
  if (files.tags) {
    recording.markers = read_marker_set(*files.tags);
    warn_of_sizes(recording.markers, *files.tags, recording.warnings);
    return;
  }
  const bool needed =
      recording.entry == RecordingEntry::kVideo || recording.entry == RecordingEntry::kCorners;
  if (!needed) return;
  throw bad_input(
      (recording.folder / "tags.yaml").string(), "no such file",
      "write one with family: tag36h11 and default_size: (edge in m), or name one with --tags");
}

void check_fixed_tags(const Recording& recording, const RecordingFiles& files) {
  for (const TagId id : recording.settings.fixed_tags) {
    const bool listed = !recording.markers.only_listed || recording.markers.sizes_m.contains(id) ||
                        recording.markers.boards.contains(id);
    if (listed) continue;
    throw bad_input(value_of(files.settings).string(),
                    fmt::format("fixed_tags names {}, which {} does not list", id.value,
                                value_of(files.tags).filename().string()),
                    "correct one of the two");
  }
}

/// One clock in a thousandth, millionth or billionth of a second: seen by how long both run, where
/// the slower one has steps over which nothing can be said. Stamps that agree are of one clock.
void require_seconds(const JointLog& log, const std::vector<double>& times_s,
                     const std::string& source) {
  constexpr double kLongStepS = 1.0;
  if (log.size() < 2 || times_s.size() < 2 || is_posture_log(log, times_s, {})) return;
  const double log_s = log.times_s.back() - log.times_s.front();
  const double frames_s = times_s.back() - times_s.front();
  if (!(log_s > 0.0 && frames_s > 0.0)) return;
  const bool slow_log = log_s > frames_s;
  if (!slow_log && times_s.size() < 3) return;  // first and last alone do not show the steps
  if (mean_step_s(slow_log ? log.times_s : times_s) <= kLongStepS) return;
  const double ratio = slow_log ? log_s / frames_s : frames_s / log_s;
  const double thousands = std::round(std::log10(ratio) / 3.0);
  if (thousands < 1.0 || thousands > 3.0) return;
  constexpr std::array<const char*, 3> kUnits{"ms", "us", "ns"};
  const std::string log_name = log.source.empty() ? "joints.csv" : log.source;
  throw bad_input(
      slow_log ? log_name : source,
      fmt::format("runs for {:.6g} s, {} for {:.6g} s: are its stamps in {}?",
                  slow_log ? log_s : frames_s, slow_log ? source : log_name,
                  slow_log ? frames_s : log_s, kUnits[static_cast<std::size_t>(thousands) - 1]),
      fmt::format("stamps are in s: divide them by {:.0f}", std::pow(1e3, thousands)));
}

/// What is declared of a camera that moves, beside what needs one at rest.
void refuse_motion_of_camera(const Recording& recording) {
  const auto& mount = recording.settings.camera_mount;
  if (!mount || *mount == CameraMount::kFixed) return;
  const auto refuse = [&](const std::string& what, const std::string& remedy) {
    throw bad_input((recording.folder / "recording.yaml").string(),
                    fmt::format("camera_mount: {} {}", to_string(*mount), what), remedy);
  };
  if (!recording.flange.empty()) {
    if (*mount == CameraMount::kCarried)
      refuse("stands beside flange.csv, whose camera is on the hand or fixed",
             "write hand or fixed");
    return;
  }
  if (!recording.cameras.empty())
    refuse("is of a single camera, and there are several",
           "name one with --video or --corners, and its intrinsics with --camera");
  if (recording.entry == RecordingEntry::kPoints)
    refuse("is of a camera, and points.csv is of a tracker at rest", "remove camera_mount");
  if (recording.settings.gravity)
    refuse("stands beside gravity, which is given in the frame of a camera at rest",
           "remove gravity: where a joint sags, tracing finds where it points");
}

void require_flange_time(const Recording& recording) {
  if (recording.flange.empty()) return;
  const PoseLog& log = recording.flange.front().log;
  if (recording.corners && !recording.corners->times_s.empty())
    require_time_overlap(log, recording.corners->times_s, "corners.csv");
  if (recording.poses && !recording.poses->times_s.empty())
    require_time_overlap(log, recording.poses->times_s, "poses.csv");
}

/// Beside poses of a hand an unknown focal length and the way to the markers are nearly one.
void require_known_camera(const Recording& recording, const RecordingFiles& files) {
  const bool by_image =
      recording.entry == RecordingEntry::kVideo || recording.entry == RecordingEntry::kCorners;
  if (!files.flange || !by_image || files.camera) return;
  throw bad_input((recording.folder / "camera.yaml").string(),
                  "no such file, and poses of a flange calibrate a camera whose lens is known",
                  "calibrate it (kinescope camera), or name its file with --camera");
}

bool are_whole_numbers(const std::vector<double>& times_s) {
  return std::ranges::all_of(times_s, [](double t) { return t == std::round(t); });
}

/// Numbers of frames or rows in place of stamps: whole, one apart or more, and they run many times
/// as long as the other clock.
void require_stamps(const std::vector<double>& times_s, const std::string& source,
                    const std::vector<double>& others_s, const std::string& other) {
  constexpr double kTimesAsLong = 5.0;
  constexpr std::size_t kFewest = 10;  // fewer may be whole by chance
  if (times_s.size() < kFewest || others_s.size() < kFewest) return;
  const auto [first, last] = std::ranges::minmax(times_s);
  const double own = last - first;
  const double others = others_s.back() - others_s.front();
  if (own < kTimesAsLong * others || !are_whole_numbers(times_s) || are_whole_numbers(others_s)) {
    return;
  }
  throw bad_input(
      source,
      fmt::format("its stamps are whole numbers that run for {:.6g} s, {} for {:.6g} s: "
                  "are they numbers of frames or rows?",
                  own, other, others),
      "stamps are in s on one clock: divide the numbers by the rate");
}

}  // namespace

std::string_view to_string(RecordingEntry entry) {
  switch (entry) {
    case RecordingEntry::kVideo:
      return "video";
    case RecordingEntry::kCorners:
      return "corners";
    case RecordingEntry::kPoses:
      return "poses";
    case RecordingEntry::kPoints:
      return "points";
  }
  return "unknown";
}

void require_time_overlap(const JointLog& log, const std::vector<double>& times_s,
                          const std::string& source) {
  if (log.empty() || times_s.empty()) return;
  constexpr std::size_t kManyFrames = 10;
  if (log.size() < 3 && times_s.size() >= kManyFrames) {
    throw bad_input(log.source.empty() ? "joints.csv" : log.source,
                    fmt::format("holds {} reading{} for {} frames", log.size(),
                                log.size() == 1 ? "" : "s", times_s.size()),
                    "log the joints all the time, ten times a second or more");
  }
  require_seconds(log, times_s, source);
  const std::string log_name = log.source.empty() ? "joints.csv" : log.source;
  require_stamps(times_s, source, log.times_s, log_name);
  require_stamps(log.times_s, log_name, times_s, source);
  const auto [first, last] = std::ranges::minmax(times_s);
  if (first <= log.times_s.back() && last >= log.times_s.front()) return;
  throw bad_input(
      log_name,
      fmt::format("runs from {:.3f} to {:.3f} s and {} from {:.3f} to {:.3f} s: no common time",
                  log.times_s.front(), log.times_s.back(), source, first, last),
      fmt::format(
          "use one clock for both; if both began together, add {:.3f} s to the times of {}: of a "
          "video by video_start in recording.yaml, the log's time at its first frame",
          log.times_s.front() - first, source));
}

void require_time_overlap(const PoseLog& log, const std::vector<double>& times_s,
                          const std::string& source) {
  JointLog stamps;
  stamps.source = log.source;
  stamps.times_s = log.times_s;
  if (!log.numbered) {
    require_time_overlap(stamps, times_s, source);
    return;
  }
  if (std::ranges::any_of(times_s, [&](double t) { return is_stamp(stamps, t); })) return;
  throw bad_input(log.source,
                  fmt::format("no number of its column '{}' ({:g} to {:g}) is the t of a frame of "
                              "{} ({:g} to {:g})",
                              log.time_column, log.times_s.front(), log.times_s.back(), source,
                              times_s.front(), times_s.back()),
                  "give each pose the t of the frame it belongs to");
}

std::string recording_name(const fs::path& folder) {
  const auto container = recorded::container_of(folder);
  const fs::path whole = fs::absolute(container ? container->path : folder).lexically_normal();
  const fs::path name = whole.has_filename() ? whole.filename() : whole.parent_path().filename();
  if (name.empty()) return "robot";
  const bool is_file = container && !fs::is_directory(container->path);
  return is_file ? name.stem().string() : name.string();
}

ReadAttempt try_read_recording(const RecordingPaths& paths) {
  ReadAttempt attempt;
  Recording& recording = attempt.recording;
  recording.folder = paths.folder;
  recording.name = recording_name(paths.folder);
  recording.settings.name = recording.name;
  const auto step = [&](const auto& read) {
    try {
      read();
    } catch (const Error& error) {
      attempt.errors.push_back(error);
    }
  };
  RecordingFiles files;
  step([&] { files = find_recording_files(paths); });
  if (!attempt.errors.empty()) return attempt;
  recording.folder = files.folder;
  recording.entry = files.entry;
  recording.warnings = files.warnings;
  recording.files = files.all();
  step([&] {
    if (files.settings) recording.settings = read_recording_settings(*files.settings);
  });
  if (recording.settings.name.empty()) recording.settings.name = recording.name;
  step([&] { read_markers(recording, files); });
  step([&] { check_fixed_tags(recording, files); });
  step([&] {
    if (!files.camera) return;
    recording.camera = read_intrinsics(*files.camera, recording.warnings);
    if (recording.camera) recording.camera_file = *files.camera;
  });
  step([&] { check_cameras(recording, files); });
  step([&] {
    if (!files.nominal) return;
    recording.nominal = read_urdf(*files.nominal);
    recording.nominal_file = *files.nominal;
    require_metres(*recording.nominal, *files.nominal);
  });
  step([&] { read_log(recording, files); });
  step([&] { read_flange_poses(recording, files); });
  step([&] { read_sightings(recording, files); });
  step([&] { refuse_motion_of_camera(recording); });
  step([&] { require_flange_time(recording); });
  step([&] { require_known_camera(recording, files); });
  return attempt;
}

Recording of_camera(const Recording& recording, const RecordedCamera& camera) {
  Recording out = recording;
  out.cameras.clear();
  out.camera_name = camera.name;
  out.video = camera.video;
  out.corners = camera.corners;
  out.camera = camera.camera;
  out.camera_file = camera.camera_file;
  const auto start = recording.settings.video_starts_s.find(camera.name);
  if (start != recording.settings.video_starts_s.end()) out.settings.video_start_s = start->second;
  return out;
}

Recording read_recording(const RecordingPaths& paths) {
  ReadAttempt attempt = try_read_recording(paths);
  if (!attempt.errors.empty()) throw attempt.errors.front();
  return std::move(attempt.recording);
}

}  // namespace kinescope
