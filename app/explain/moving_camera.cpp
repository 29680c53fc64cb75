// SPDX-License-Identifier: Apache-2.0
#include "app/explain/moving_camera.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "app/explain/declared.h"
#include "calib/bundle/place_markers.h"
#include "calib/tracks/merged_bodies.h"
#include "calib/tracks/tracks_from_base.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"
#include "kinematics/structure/chain_clock.h"
#include "kinematics/structure/rerooted.h"
#include "kinematics/structure/rigid_bodies.h"

namespace kinescope {
namespace {

constexpr std::string_view kSettingsName = "recording.yaml";
// By as much a chain's clock is off (chain_clock_test.cpp), and a search finds the rest.
constexpr std::array kAboutChainClock_s{0.0, 0.008, -0.008, 0.016, -0.016, 0.024, -0.024};

bool is_on_hand(const Recording& recording) {
  return recording.settings.camera_mount == CameraMount::kOnHand;
}

bool is_carried(const Recording& recording) {
  return recording.settings.camera_mount == CameraMount::kCarried;
}

StructureOptions options_of(const Recording& recording, const CalibrateOptions& options) {
  StructureOptions out;
  out.scan_time_offset = options.estimate_time_offset;
  out.units = declared_units(recording);
  return out;
}

bool is_answer(const Structure& structure) {
  return (structure.status == StructureStatus::kDetermined ||
          structure.status == StructureStatus::kAmbiguous) &&
         structure.free_markers.empty() &&
         std::ranges::any_of(structure.joints,
                             [](const StructureJoint& joint) { return joint.channel.has_value(); });
}

// The base markers on link 0, beside what else was found at rest there.
void put_base_on(const BaseView& view, Structure& structure) {
  StructureLink& base = structure.links.front();
  for (std::size_t k = 0; k < view.markers.size(); ++k) {
    const auto at = std::ranges::upper_bound(base.markers, view.markers[k]) - base.markers.begin();
    base.markers.insert(base.markers.begin() + at, view.markers[k]);
    base.T_reference_marker.insert(base.T_reference_marker.begin() + at, view.T_base_marker[k]);
  }
}

// Of a log whose clock is set back: joint-log time = frame time + offset.
JointLog set_back(JointLog log, double by_s) {
  for (double& t : log.times_s) t -= by_s;
  return log;
}

// At the clocks' offset at which a chain of joints explains the body seen most, or near it; nothing
// where no robot shows there.
std::optional<Structure> find_by_chain_clock(const PoseTracks& tracks, const JointLog& log,
                                             const StructureOptions& options) {
  if (!options.scan_time_offset || log.empty() || tracks.tracks.empty()) return std::nullopt;
  const auto most = std::ranges::max_element(tracks.tracks, {},
                                             [](const PoseTrack& t) { return t.samples.size(); });
  const std::optional<double> offset_s =
      chain_clock_offset(*most, tracks.times_s, log, options.max_time_offset_s, options.max_gap_s);
  if (!offset_s) return std::nullopt;
  for (const double about_s : kAboutChainClock_s) {
    Structure out = find_structure(tracks, set_back(log, *offset_s + about_s), options);
    out.time_offset_s += *offset_s + about_s;
    if (is_answer(out)) return out;
  }
  return std::nullopt;
}

// With what is rigid as one body each.
Structure find_merged(const PoseTracks& tracks, const JointLog& log,
                      const StructureOptions& options) {
  const MergedBodies merged = merge_rigid_bodies(tracks);
  Structure out = find_structure(merged.tracks, log, options);
  if (!is_answer(out)) {
    if (auto other = find_by_chain_clock(merged.tracks, log, options)) out = *std::move(other);
  }
  put_back(merged.bodies, out);
  return out;
}

// Markers that all stand still: a link without joints.
Structure map_alone(const PoseTracks& tracks) {
  Structure out;
  out.status = StructureStatus::kDetermined;
  out.probability = 1.0;
  out.links.resize(1);
  out.joint_values.resize(static_cast<Eigen::Index>(tracks.times_s.size()), 0);
  return out;
}

Structure seen_from(std::span<const TagId> base, const PoseTracks& tracks, const JointLog& log,
                    const StructureOptions& options) {
  const BaseView view = tracks_from_base(tracks, base);
  Structure out =
      view.others.tracks.empty() ? map_alone(tracks) : find_merged(view.others, log, options);
  put_base_on(view, out);
  return out;
}

// How far the camera goes about in a link's frame: the least of the robot's base, where a hand and
// the joints move independently. Squared, rad and kLever m alike.
double motion_of_camera(const PoseTracks& tracks, const std::vector<TagId>& link) {
  constexpr double kLever_m = 0.3;
  const BaseView view = tracks_from_base(tracks, link);
  std::vector<double> steps;
  const CameraPose* last = nullptr;
  for (const auto& camera : view.cameras) {
    if (last != nullptr && camera) {
      const Vector6d d = log_pose(last->T_camera_base * camera->T_camera_base.inverse());
      steps.push_back(d.head<3>().squaredNorm() +
                      d.tail<3>().squaredNorm() / (kLever_m * kLever_m));
    }
    last = camera ? &*camera : nullptr;
  }
  return steps.empty() ? std::numeric_limits<double>::infinity() : median_of(std::move(steps));
}

struct ChosenBase {
  std::vector<TagId> markers;
  std::string why;
};

// The link from which the log's columns stand in the order of the joints; else the one in whose
// frame the camera moves least.
ChosenBase base_of(const Structure& structure, const PoseTracks& tracks, const JointLog& log) {
  std::vector<std::vector<TagId>> links;
  std::vector<std::vector<TagId>> in_order;
  for (std::size_t l = 0; l < structure.links.size(); ++l) {
    const std::vector<TagId>& markers = structure.links[l].markers;
    if (markers.empty()) continue;
    links.push_back(markers);
    if (stands_in_order(rerooted(structure, static_cast<int>(l)), log)) in_order.push_back(markers);
  }
  if (in_order.size() == 1)
    return {in_order.front(), "from it the columns of the log stand in the order of the joints"};
  const auto least = std::ranges::min_element(links, {}, [&](const std::vector<TagId>& markers) {
    return motion_of_camera(tracks, markers);
  });
  return {*least, "in its frame the camera moves least"};
}

// Of the bodies the one from which the rest is a robot; the largest that is seen so.
std::optional<Structure> robot_seen_from_a_body(const PoseTracks& tracks,
                                                const Recording& recording,
                                                const CalibrateOptions& options) {
  constexpr std::size_t kMostTried = 3;  // bodies: from any of a robot's it is one
  const std::vector<std::vector<TagId>> bodies = rigid_bodies(tracks);
  if (bodies.size() < 2) return std::nullopt;
  for (std::size_t k = 0; k < std::min(kMostTried, bodies.size()); ++k) {
    Structure structure =
        seen_from(bodies[k], tracks, recording.log, options_of(recording, options));
    if (is_answer(structure)) return structure;
  }
  return std::nullopt;
}

std::string tag_words(const std::vector<TagId>& tags) {
  constexpr std::size_t kMost = 4;
  std::string out;
  for (std::size_t k = 0; k < std::min(kMost, tags.size()); ++k)
    out += fmt::format("{}tag_{}", k == 0 ? "" : ", ", tags[k].value);
  return tags.size() > kMost ? out + fmt::format(" and {} more", tags.size() - kMost) : out;
}

void require_seen(const PoseTracks& tracks, const Recording& recording) {
  for (const TagId id : recording.settings.fixed_tags) {
    if (std::ranges::find(tracks.tracks, id, &PoseTrack::id) != tracks.tracks.end()) continue;
    throw bad_input((recording.folder / kSettingsName).string(),
                    fmt::format("fixed_tags names {}, which is not seen", id.value),
                    "correct the id, or keep the marker in view");
  }
}

std::string settle_carried(const PoseTracks& tracks, const CalibrateOptions& options,
                           bool is_declared, Recording& recording) {
  const char* how = is_declared ? "The camera is declared as carried by a person"
                                : "A person carried the camera: no marker stands still in its "
                                  "frame, and seen from markers that keep their places among one "
                                  "another the others follow the log";
  if (!recording.settings.fixed_tags.empty()) {
    return fmt::format("{}; its path is that against {}.", how,
                       tag_words(recording.settings.fixed_tags));
  }
  const auto robot = robot_seen_from_a_body(tracks, recording, options);
  if (!robot) {
    throw undetermined("camera_mount", "from no body of markers do the others move as the log says",
                       "declare the markers at rest as fixed_tags in recording.yaml; keep one of "
                       "them in view");
  }
  const ChosenBase base = base_of(*robot, tracks, recording.log);
  recording.settings.fixed_tags = base.markers;
  return fmt::format(
      "{}; its path is that against {}, taken as the robot's base because {} (else declare the "
      "base's markers: fixed_tags: [..] in recording.yaml).",
      how, tag_words(base.markers), base.why);
}

// Without a log all that is rigid is a map, whoever moved.
std::string settle_map(const PoseTracks& tracks, Recording& recording) {
  const std::vector<std::vector<TagId>> bodies = rigid_bodies(tracks);
  if (bodies.size() != 1 || bodies.front().size() < 2) return "";
  recording.settings.camera_mount = CameraMount::kCarried;
  recording.settings.fixed_tags = bodies.front();
  return "All markers keep their places among one another: they are mapped, and the camera's path "
         "against them is estimated.";
}

// From the camera; in the order that a camera on the robot has it, where the other is no robot.
Structure seen_from_camera(const PoseTracks& tracks, const Recording& recording,
                           const CalibrateOptions& options) {
  StructureOptions search = options_of(recording, options);
  Structure fixed = find_merged(tracks, recording.log, search);
  if (is_answer(fixed) || rigid_bodies(tracks).size() != 1) return fixed;
  search.camera_on_robot = true;
  Structure on_robot = find_merged(tracks, recording.log, search);
  return is_answer(on_robot) ? on_robot : fixed;
}

std::string settle_undeclared(const Observed& observed, const PoseTracks& tracks,
                              const CalibrateOptions& options, Recording& recording) {
  const bool is_plain = observed.cameras.empty() && !recording.nominal && !tracks.tracks.empty() &&
                        !recording.settings.gravity && recording.settings.fixed_tags.empty();
  if (!is_plain || is_any_at_rest(tracks)) return "";
  if (recording.log.empty()) return settle_map(tracks, recording);
  const Structure fixed = seen_from_camera(tracks, recording, options);
  if (is_answer(fixed)) {
    if (is_chain_reversed(fixed, recording.log)) {
      recording.settings.camera_mount = CameraMount::kOnHand;
      return "The camera is taken to ride on the robot's last link, before markers at rest: all "
             "markers are one body, and the columns of the log stand from the joint next to the "
             "camera last to first. A fixed camera before the robot's hand would see the same: "
             "declare that as camera_mount: fixed in recording.yaml.";
    }
    const bool is_in_order = stands_in_order(fixed, recording.log) && fixed.doubts.empty();
    if (shows_one_body(fixed) && !is_in_order) {
      return "The camera is taken as fixed. On the robot, before markers at rest, it would see the "
             "same: declare that as camera_mount: hand in recording.yaml.";
    }
    return "";
  }
  const auto robot = robot_seen_from_a_body(tracks, recording, options);
  if (!robot) return "";
  recording.settings.camera_mount = CameraMount::kCarried;
  return settle_carried(tracks, options, false, recording);
}

// Mean of what the base's markers, or where none is seen the best known of the others, say.
std::vector<Pose> path_beside(const CalibrationStart& start, const PoseTracks& tracks,
                              const Eigen::MatrixXd& values) {
  constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();
  Pose unknown;
  unknown.translation.setConstant(kNotKnown);
  std::vector<Pose> out(tracks.times_s.size(), unknown);
  std::vector<double> least(out.size(), std::numeric_limits<double>::infinity());
  for (const PoseTrack& track : tracks.tracks) {
    const Marker* marker = start.tree.marker(track.id);
    if (marker == nullptr) continue;
    for (const PoseSample& sample : track.samples) {
      const auto f = static_cast<std::size_t>(sample.frame);
      Pose T_base_link;
      if (marker->link.value != 0) {
        const Eigen::VectorXd q = values.row(sample.frame);
        if (!q.allFinite()) continue;
        T_base_link = forward_kinematics(start.tree, q)[marker->link.index()];
      }
      // Any of the base before any of the robot, of which less is known at a start.
      constexpr double kBehindBase = 1e6;
      const double doubt =
          (marker->link.value == 0 ? 1.0 : kBehindBase) * sample.covariance.trace();
      if (doubt >= least[f]) continue;
      least[f] = doubt;
      out[f] = sample.T_camera_marker * (T_base_link * marker->T_link_marker).inverse();
    }
  }
  return out;
}

Eigen::MatrixXd values_at(const KinematicTree& tree, const JointLog& log, double ahead_s,
                          const std::vector<double>& times_s, const Eigen::MatrixXd& undriven) {
  const Eigen::MatrixXd readings = resample(log, times_s, ahead_s);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(times_s.size()),
                                              static_cast<Eigen::Index>(tree.joints.size()));
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    const auto column = static_cast<Eigen::Index>(j);
    const auto channel = log.channel(joint.channel);
    if (!channel) {
      if (undriven.cols() > column) out.col(column) = undriven.col(column);
      continue;
    }
    Eigen::VectorXd sum = readings.col(*channel);
    for (const ChannelShare& share : joint.couplings) {
      if (const auto other = log.channel(share.channel)) sum += share.ratio * readings.col(*other);
    }
    out.col(column) = (joint.scale * sum).array() + joint.offset;
  }
  return out;
}

// The largest body that keeps together, or what is declared.
std::vector<TagId> world_markers(const Recording& recording, const PoseTracks& tracks) {
  if (!recording.settings.fixed_tags.empty()) return recording.settings.fixed_tags;
  const std::vector<std::vector<TagId>> bodies = rigid_bodies(tracks);
  if (!bodies.empty()) return bodies.front();
  throw undetermined("camera_mount", "no marker was seen often enough",
                     "keep markers at rest in view");
}

// An id that no marker has, for the camera as a body in the world's frame.
TagId free_id(const PoseTracks& tracks) {
  int most = 0;
  for (const PoseTrack& track : tracks.tracks) most = std::max(most, track.id.value);
  return TagId{most + 1};
}

PoseTrack as_body(const BaseView& view, TagId id) {
  PoseTrack out{id, {}};
  for (std::size_t f = 0; f < view.cameras.size(); ++f) {
    if (!view.cameras[f]) continue;
    PoseSample& sample = out.samples.emplace_back();
    sample.frame = static_cast<int>(f);
    sample.T_camera_marker = view.cameras[f]->T_camera_base.inverse();
    const Matrix6d A = adjoint(view.cameras[f]->T_camera_base);
    sample.covariance = A * view.cameras[f]->covariance * A.transpose();
  }
  return out;
}

}  // namespace

std::string settle_camera(const Observed& observed, const PoseTracks& tracks,
                          const CalibrateOptions& options, Recording& recording) {
  if (!recording.settings.camera_mount)
    return settle_undeclared(observed, tracks, options, recording);
  if (recording.settings.camera_mount == CameraMount::kFixed) return "";
  require_seen(tracks, recording);
  if (is_on_hand(recording)) return "The camera is declared to ride on the robot.";
  if (recording.nominal) {
    recording.settings.fixed_tags = world_markers(recording, tracks);
    return fmt::format(
        "The camera is declared as carried by a person; its path is that against {}.",
        tag_words(recording.settings.fixed_tags));
  }
  return settle_carried(tracks, options, true, recording);
}

bool moves_camera(const Recording& recording) {
  return is_on_hand(recording) || is_carried(recording);
}

Structure structure_from_base(const Recording& recording, const PoseTracks& tracks,
                              const StructureOptions& options) {
  if (is_carried(recording))
    return seen_from(recording.settings.fixed_tags, tracks, recording.log, options);
  StructureOptions from_camera = options;
  from_camera.camera_on_robot = is_on_hand(recording);
  if (!is_on_hand(recording)) return find_structure(tracks, recording.log, from_camera);
  const Structure out = find_merged(tracks, recording.log, from_camera);
  const auto link = link_at_rest(out, recording.log, recording.settings.fixed_tags);
  return link ? rerooted(out, *link) : out;
}

void add_moving_camera(const Recording& recording, const Structure& structure,
                       const PoseTracks& tracks, CalibrationStart& start) {
  if (is_on_hand(recording)) {
    const auto above =
        std::ranges::find(structure.joints, structure.camera_link, &StructureJoint::child_link);
    if (above == structure.joints.end()) {
      throw undetermined("camera_mount", "no joint moves the camera against the markers at rest",
                         "move every joint with markers at rest in view, or declare camera_mount: "
                         "fixed");
    }
    start.moving = MovingCamera{LinkId{structure.camera_link}, above->T_joint_child.inverse(), {}};
    return;
  }
  if (!is_carried(recording)) return;
  start.moving = MovingCamera{LinkId{0},
                              {},
                              path_beside(start, tracks,
                                          values_at(start.tree, recording.log, start.time_offset_s,
                                                    tracks.times_s, start.joint_values))};
}

void place_moving_camera(const Recording& recording, const PoseTracks& tracks,
                         const Eigen::MatrixXd& values, CalibrationStart& start) {
  const BaseView view = tracks_from_base(tracks, world_markers(recording, tracks));
  PoseTracks bodies = view.others;
  const TagId camera = free_id(tracks);
  if (is_on_hand(recording)) bodies.tracks.push_back(as_body(view, camera));
  const Placement placed = place_markers(start.tree, values, bodies);
  const Pose T_base_world = placed.T_camera_base.inverse();
  for (std::size_t k = 0; k < view.markers.size(); ++k)
    start.tree.markers.push_back(
        {view.markers[k], LinkId{0}, T_base_world * view.T_base_marker[k], 0.0});
  for (const Marker& marker : placed.markers) {
    if (marker.id != camera || !is_on_hand(recording)) {
      start.tree.markers.push_back(marker);
      continue;
    }
    start.moving = MovingCamera{marker.link, marker.T_link_marker.inverse(), {}};
  }
  if (is_carried(recording))
    start.moving = MovingCamera{LinkId{0}, {}, path_beside(start, tracks, values)};
  if (start.moving->on_robot() || is_carried(recording)) return;
  throw undetermined("camera_mount", "the camera moves with no link of the nominal robot",
                     "check camera_mount, and that the markers at rest are declared as fixed_tags");
}

PoseTracks as_of_fixed_camera(const Recording& recording, const PoseTracks& tracks) {
  if (is_on_hand(recording)) return merge_rigid_bodies(tracks).tracks;
  if (!is_carried(recording)) return tracks;
  return tracks_from_base(tracks, recording.settings.fixed_tags).others;
}

}  // namespace kinescope
