// SPDX-License-Identifier: Apache-2.0
#include "app/explain/pipeline.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/explain/declared.h"
#include "app/explain/families_in_video.h"
#include "app/explain/moving_camera.h"
#include "app/explain/nominal_channels.h"
#include "app/explain/own_units.h"
#include "app/explain/recording_pieces.h"
#include "calib/bundle/place_markers.h"
#include "calib/camera/camera_file.h"
#include "calib/tracks/camera_from_tags.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "calib/tracks/several_cameras.h"
#include "calib/vision/repeated_frames.h"
#include "calib/vision/thinned_frames.h"
#include "calib/vision/video.h"
#include "kinematics/core/error.h"
#include "kinematics/core/mean_step.h"
#include "kinematics/core/median.h"
#include "kinematics/core/rotation_between.h"
#include "kinematics/model/usual_unit.h"

namespace kinescope {
namespace {

// What the video does show, where no marker of the declared family is found in it.
struct Hint {
  std::string seen;
  std::string remedy =
      "check the family in tags.yaml, and that the markers are sharp and at least 20 pixels wide";
};

Hint hint_of(const Recording& recording) {
  if (recording.video.empty()) return {};
  const std::string& family = recording.markers.family;
  if (is_mirrored(recording.video, family)) {
    return {"; mirrored they are there", "record or export the video without mirroring"};
  }
  const std::vector<std::string> others = other_families(recording.video, family);
  if (others.empty()) return {};
  return {fmt::format(", but markers of {}", fmt::join(others, ", ")),
          "correct the family in tags.yaml"};
}

void require_markers(const Recording& recording, const TagObservations& tags) {
  const std::string source =
      recording.video.empty() ? recording.folder.string() : recording.video.string();
  if (tags.observations.empty()) {
    std::map<std::string, int> reasons;
    for (const RejectedTag& tag : tags.rejected) ++reasons[tag.reason];
    std::string rejected;
    for (const auto& [reason, count] : reasons) {
      rejected += fmt::format("{}{} x {}", rejected.empty() ? "; rejected: " : ", ", count, reason);
    }
    const Hint hint = rejected.empty() ? hint_of(recording) : Hint{};
    throw NothingSeen(
        bad_input(source,
                  fmt::format("no marker of family {} was found in {} frames{}{}",
                              recording.markers.family, tags.times_s.size(), rejected, hint.seen),
                  hint.remedy));
  }
  std::set<int> unsized;
  for (const TagObservation& seen : tags.observations) {
    if (!recording.markers.boards.contains(seen.id) && !(recording.markers.size_m(seen.id) > 0.0)) {
      unsized.insert(seen.id.value);
    }
  }
  if (!unsized.empty()) {
    throw bad_input(
        (recording.folder / "tags.yaml").string(),
        fmt::format("no size for the markers seen with id {}", fmt::join(unsized, ", ")),
        "give default_size, or the size of each, in metres");
  }
}

// Couplings by design: a counter-commanded joint follows another one to one. What is smaller than
// the tolerance of a unit is an effect of the robot and not part of the start.
std::vector<ChannelShare> couplings_by_design(const StructureJoint& joint, const JointLog& log) {
  std::vector<ChannelShare> out;
  if (!joint.channel) return out;
  for (const ChannelTerm& term : joint.couplings) {
    double ratio = term.scale / joint.channel->scale;
    if (std::abs(ratio) < kUnitTolerance) continue;
    if (std::abs(std::abs(ratio) - 1.0) < kUnitTolerance) ratio = std::copysign(1.0, ratio);
    out.push_back({log.channels[static_cast<std::size_t>(term.channel)], ratio});
  }
  return out;
}

// The base frame seen from the frame the structure stands in (the camera's).
Pose base_frame(const KinematicTree& tree, const std::optional<Eigen::Vector3d>& gravity) {
  Pose T_camera_base;
  const Marker* anchor = nullptr;
  for (const Marker& marker : tree.markers) {
    if (marker.link == LinkId{0} && anchor == nullptr) anchor = &marker;
  }
  if (anchor != nullptr) {
    // A tag's z points into it: turned about x, the base's z leaves the tag.
    T_camera_base = anchor->T_link_marker;
    T_camera_base.rotation = T_camera_base.rotation * exp_rotation({std::numbers::pi, 0.0, 0.0});
  } else {
    // Upright before a level camera: x away from it, z up.
    Eigen::Matrix3d R;
    R << 0, -1, 0, 0, 0, -1, 1, 0, 0;
    T_camera_base.rotation = Eigen::Quaterniond(R);
  }
  if (gravity) {
    const Eigen::Vector3d up = -gravity->normalized();
    const Eigen::Vector3d z = T_camera_base.rotation * Eigen::Vector3d::UnitZ();
    T_camera_base.rotation = (rotation_between(z, up) * T_camera_base.rotation).normalized();
  }
  return T_camera_base;
}

void move_base(KinematicTree& tree, const Pose& T_camera_base) {
  const Pose T_base_camera = T_camera_base.inverse();
  for (Joint& joint : tree.joints) {
    if (joint.parent == LinkId{0}) joint.T_parent_joint = T_base_camera * joint.T_parent_joint;
  }
  for (Marker& marker : tree.markers) {
    if (marker.link == LinkId{0}) marker.T_link_marker = T_base_camera * marker.T_link_marker;
  }
}

Eigen::MatrixXd nominal_values(const Recording& recording, const KinematicTree& tree,
                               const std::vector<double>& times_s) {
  const Eigen::MatrixXd readings = resample(recording.log, times_s);
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(times_s.size()),
                                                 static_cast<Eigen::Index>(tree.joints.size()));
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const auto channel = recording.log.channel(tree.joints[j].channel);
    if (!channel || tree.joints[j].type == JointType::kFixed) continue;
    values.col(static_cast<Eigen::Index>(j)) =
        (tree.joints[j].scale * readings.col(*channel)).array() + tree.joints[j].offset;
  }
  return values;
}

// A marker that would move with a joint without a column sits as well before that joint.
void place_before_held_joints(KinematicTree& tree) {
  for (Marker& marker : tree.markers) {
    const std::vector<JointId> path = tree.path_to(marker.link);
    const auto held = std::ranges::find_if(path, [&](JointId id) {
      const Joint& joint = tree.joints[id.index()];
      return is_movable(joint) && joint.channel.empty();
    });
    if (held == path.end()) continue;
    Pose T_parent_link;
    for (auto id = held; id != path.end(); ++id) {
      T_parent_link = T_parent_link * tree.joints[id->index()].T_parent_joint;
    }
    marker.link = tree.joints[held->index()].parent;
    marker.T_link_marker = T_parent_link * marker.T_link_marker;
  }
}

// Of joints that no channel drives: as at the reference camera's frame that is nearest in time.
Eigen::MatrixXd at_all_frames(const Measurements& measurements, const Eigen::MatrixXd& values) {
  const std::vector<int> reference = frames_of_reference(measurements.camera_of_frame);
  const auto time_of = [&](std::size_t k) {
    return measurements.times_s[static_cast<std::size_t>(reference[k])];
  };
  Eigen::MatrixXd out(static_cast<Eigen::Index>(measurements.times_s.size()), values.cols());
  std::size_t nearest = 0;
  for (std::size_t f = 0; f < measurements.times_s.size(); ++f) {
    const auto away = [&](std::size_t k) { return std::abs(time_of(k) - measurements.times_s[f]); };
    while (nearest + 1 < reference.size() && away(nearest + 1) <= away(nearest)) ++nearest;
    out.row(static_cast<Eigen::Index>(f)) = values.row(static_cast<Eigen::Index>(nearest));
  }
  return out;
}

// What all trackers measured, in the reference one's frame.
PointObservations in_one_frame(const Observed& observed) {
  const Measurements& measurements = observed.measurements;
  PointObservations out = measurements.points;
  if (observed.cameras.empty()) return out;
  for (PointObservation& point : out.observations) {
    const auto camera = static_cast<std::size_t>(
        measurements.camera_of_frame[static_cast<std::size_t>(point.frame)]);
    if (point.position_m)
      point.position_m = observed.cameras[camera].T_reference_camera * *point.position_m;
  }
  return out;
}

double edge_px(const TagObservation& seen) {
  double sum = 0.0;
  const std::size_t n = seen.corners_px.size();
  for (std::size_t i = 0; i < n; ++i) {
    sum += (seen.corners_px[i] - seen.corners_px[(i + 1) % n]).norm();
  }
  return sum / static_cast<double>(n);
}

// Where neighbouring frames say nearly the same: of motion, not of postures.
bool is_film(const Recording& recording, const std::vector<double>& times_s) {
  constexpr double kSlowest_s = 0.5;  // between two frames; chosen
  if (times_s.size() < 2 || mean_step_s(times_s) > kSlowest_s) return false;
  return recording.flange.empty() ? !is_of_postures(recording.log, times_s)
                                  : !is_posture_log(recording.flange.front().log, times_s);
}

void measure_corners(Observed& observed) {
  observed.measurements.times_s = observed.tags.times_s;
  observed.measurements.corners = observed.tags.observations;
}

}  // namespace

void leave_out_neighbours(const Recording& recording, int k, Observed& observed) {
  if (k < 2 || !is_film(recording, observed.tags.times_s)) return;
  observed.warnings.push_back(fmt::format(
      "{} sightings in {} frames: one frame in {} is calibrated on, which says nearly as much",
      observed.tags.observations.size(), observed.tags.times_s.size(), k));
  TagObservations thinned = every_kth_frame(observed.tags, k);
  if (!observed.detected) observed.detected = std::move(observed.tags);
  observed.tags = std::move(thinned);
  measure_corners(observed);
}

Observed observe(const Recording& recording, const SightOptions& options,
                 const std::optional<CameraModel>& lens,
                 const std::optional<TagObservations>& cached, const Progress& progress) {
  Observed out;
  switch (recording.entry) {
    case RecordingEntry::kVideo: {
      if (cached) {
        out.tags = *cached;
      } else {
        // Before the long work.
        const VideoInfo video = open_video(recording.video)->info();
        DetectOptions detect = options.detect;
        detect.lens = lens;
        if (lens) {
          detect.lens =
              with_image_size(*lens, video.width, video.height, recording.camera_file.string());
        }
        Detection detection = detect_tags(recording.video, recording.markers, detect, progress);
        out.tags = std::move(detection.observations);
        out.tags.warnings = std::move(detection.warnings);
        for (double& t : out.tags.times_s) t += recording.settings.video_start_s;
      }
      out.warnings = out.tags.warnings;
      break;
    }
    case RecordingEntry::kCorners:
      out.tags = value_of(recording.corners);
      break;
    case RecordingEntry::kPoses:
      out.measurements.poses = value_of(recording.poses);
      out.measurements.times_s = out.measurements.poses.times_s;
      break;
    case RecordingEntry::kPoints:
      out.measurements.points = value_of(recording.points);
      out.measurements.points.distances = recording.settings.target_distances;
      out.measurements.times_s = out.measurements.points.times_s;
      break;
  }
  if (recording.entry == RecordingEntry::kVideo || recording.entry == RecordingEntry::kCorners) {
    require_markers(recording, out.tags);
    leave_out_repeated_frames(out.tags);
    measure_corners(out);
    leave_out_neighbours(recording, thinning_of(corners_of(out.tags)), out);
  }
  if (recording.entry == RecordingEntry::kVideo) {
    require_time_overlap(recording.log, out.measurements.times_s, recording.video.string());
  }
  return out;
}

CameraModel choose_camera(const Recording& recording, const TagObservations& tags) {
  if (tags.observations.empty()) return {};
  if (!recording.camera) return camera_from_tags(tags, recording.markers);
  if (tags.width == 0) return *recording.camera;
  return with_image_size(*recording.camera, tags.width, tags.height,
                         recording.camera_file.string());
}

std::string model_remedy(RecordingEntry entry, bool camera_declared) {
  if (entry == RecordingEntry::kPoses) {
    return "check that all poses are in one frame that stood still, in m and rad, that no marker "
           "has slipped and that each reading of joints.csv belongs to its pose";
  }
  return std::string(camera_declared ? "check that camera.yaml is this camera's, "
                                     : "calibrate the camera (kinescope camera); check ") +
         "that tags.yaml has every marker's size, that no marker has slipped and that the camera "
         "stood still, its focus and zoom fixed";
}

Structure find_robot(const Recording& recording, const PoseTracks& tracks,
                     const CalibrateOptions& options, std::optional<double> allowance) {
  if (recording.entry == RecordingEntry::kPoints) {
    throw bad_request("points.csv", "points alone do not show a structure",
                      "give a nominal robot with --nominal robot.urdf");
  }
  StructureOptions structure_options;
  structure_options.scan_time_offset = options.estimate_time_offset;
  structure_options.units = declared_units(recording);
  structure_options.allowance = allowance;
  return as_robot(recording, structure_from_base(recording, tracks, structure_options));
}

Structure as_robot(const Recording& recording, Structure structure) {
  for (StructureDoubt& doubt : structure.doubts) {
    if (doubt.of_model) doubt.remedy = model_remedy(recording.entry, recording.camera.has_value());
  }
  require_declared_units(recording, structure);
  require_fixed_tags(recording, structure);
  return structure;
}

CalibrationStart start_from_structure(const Structure& structure, const Recording& recording,
                                      const CameraModel& camera) {
  CalibrationStart start;
  start.tree = structure_tree(structure, recording.log);
  start.tree.name = recording.settings.name;
  for (std::size_t j = 0; j < start.tree.joints.size(); ++j) {
    Joint& joint = start.tree.joints[j];
    joint.scale = is_declared_in_si(recording, joint)
                      ? 1.0
                      : usual_unit(joint.type, joint.scale).value_or(joint.scale);
    joint.couplings = couplings_by_design(structure.joints[j], recording.log);
  }
  for (Marker& marker : start.tree.markers) marker.size_m = recording.markers.size_m(marker.id);
  start.T_camera_base = base_frame(start.tree, recording.settings.gravity);
  move_base(start.tree, start.T_camera_base);
  start.camera = camera;
  start.time_offset_s = structure.time_offset_s;
  start.joint_values = structure.joint_values;
  return start;
}

bool take_usual_units(const KinematicTree& calibrated, CalibrationStart& start) {
  bool any = false;
  for (std::size_t j = 0; j < start.tree.joints.size(); ++j) {
    Joint& joint = start.tree.joints[j];
    const auto found = usual_unit(joint.type, calibrated.joints[j].scale);
    if (usual_unit(joint.type, joint.scale) || !found) continue;
    joint.scale = *found;
    any = true;
  }
  return any;
}

std::optional<CameraModel> camera_from_motion(const Recording& recording, const Observed& observed,
                                              const CameraModel& camera, CalibrateOptions options) {
  options.estimate_intrinsics = true;
  options.folds = 0;
  try {
    const PoseTracks tracks = pose_tracks_from_tags(observed.tags, camera, recording.markers);
    const Structure structure = find_robot(recording, tracks, options);
    require_determined(structure);
    CalibrationStart start = start_from_structure(structure, recording, camera);
    add_moving_camera(recording, structure, tracks, start);
    const Calibration calibration =
        calibrate(observed.measurements, recording.markers, recording.log, start, options);
    if (calibration.status != CalibrationStatus::kUndetermined) return calibration.camera;
  } catch (const Error&) {
    // What is wrong will be said of the answer, not of this first look.
    return std::nullopt;
  }
  return std::nullopt;
}

void add_further_cameras(const Observed& observed, CalibrationStart& start) {
  if (observed.cameras.empty()) return;
  start.camera_name = observed.cameras.front().name;
  start.further_cameras.clear();
  for (const ObservedCamera& camera : observed.cameras) {
    if (&camera == &observed.cameras.front()) continue;
    start.further_cameras.push_back({camera.name,
                                     camera.T_reference_camera.inverse() * start.T_camera_base,
                                     camera.model, 0.0, camera.estimate_intrinsics});
  }
  if (start.joint_values.size() > 0)
    start.joint_values = at_all_frames(observed.measurements, start.joint_values);
}

CheckedNominal start_from_nominal(const Recording& recording, const Observed& observed,
                                  const PoseTracks& tracks, const CameraModel& camera,
                                  std::vector<std::string>& warnings) {
  const Measurements& measurements = observed.measurements;
  NominalChannels matched = match_channels(recording);
  if (!tracks.tracks.empty()) {
    StructureOptions structure_options;
    structure_options.units = declared_units(recording);
    const Structure structure = structure_from_base(
        recording, at_common_instants(tracks, measurements.camera_of_frame), structure_options);
    if (matched.in_order) matched = by_motion(std::move(matched), structure, recording.log);
    require_drawn_types(matched, structure, recording);
    matched = with_own_units(std::move(matched), structure, recording);
  }
  require_columns_known(matched, recording.log);
  const KinematicTree& nominal = matched.tree;
  warnings.insert(warnings.end(), matched.warnings.begin(), matched.warnings.end());
  const auto place = [&](const KinematicTree& tree) {
    CalibrationStart start;
    start.tree = tree;
    start.nominal = true;
    start.camera = camera;
    const Eigen::MatrixXd values = nominal_values(recording, tree, measurements.times_s);
    start.tree.markers.clear();
    if (moves_camera(recording)) {
      place_moving_camera(recording, tracks, values, start);
    } else {
      const Placement placement = recording.entry == RecordingEntry::kPoints
                                      ? place_points(tree, values, in_one_frame(observed))
                                      : place_markers(tree, values, tracks);
      start.T_camera_base = placement.T_camera_base;
      start.tree.markers = placement.markers;
    }
    place_before_held_joints(start.tree);
    for (Marker& marker : start.tree.markers) marker.size_m = recording.markers.size_m(marker.id);
    add_further_cameras(observed, start);
    return start;
  };
  CheckedNominal checked =
      check_nominal(nominal, place, measurements, recording.markers, recording.log);
  require_fixed_tags(recording, checked.start.tree);
  return checked;
}

void require_determined(const Structure& structure) {
  if (structure.status == StructureStatus::kDetermined ||
      structure.status == StructureStatus::kAmbiguous) {
    return;
  }
  if (structure.doubts.empty()) {
    throw undetermined("structure", "the recording does not determine the robot's structure",
                       "move every joint by at least 20 degrees (or 50 mm), each at its own time");
  }
  std::string what = structure.doubts.front().what;
  for (std::size_t i = 1; i < structure.doubts.size(); ++i) what += "; " + structure.doubts[i].what;
  throw undetermined("structure", what, structure.doubts.front().remedy);
}

std::vector<MarkerSummary> summarise_markers(const Observed& observed, const MarkerSet& markers) {
  std::map<TagId, std::vector<const TagObservation*>> seen;
  for (const TagObservation& tag : all_tags(observed).observations) seen[tag.id].push_back(&tag);
  std::vector<MarkerSummary> out;
  for (const auto& [id, sightings] : seen) {
    std::vector<double> edges;
    std::vector<double> sigmas;
    for (const TagObservation* tag : sightings) {
      edges.push_back(edge_px(*tag));
      sigmas.push_back(tag->sigma_px);
    }
    out.push_back({id, markers.size_m(id), static_cast<int>(sightings.size()), median_of(edges),
                   median_of(sigmas)});
  }
  for (const PoseTrack& track : observed.measurements.poses.tracks) {
    out.push_back({track.id, 0.0, static_cast<int>(track.samples.size()), 0.0, 0.0});
  }
  std::map<TagId, int> points;
  for (const PointObservation& point : observed.measurements.points.observations) {
    ++points[point.id];
  }
  for (const auto& [id, count] : points) out.push_back({id, 0.0, count, 0.0, 0.0});
  return out;
}

}  // namespace kinescope
