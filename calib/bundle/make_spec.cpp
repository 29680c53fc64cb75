// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/make_spec.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "calib/bundle/postures.h"
#include "kinematics/core/error.h"

namespace kinescope::bundle {
namespace {

constexpr TangentMask kAllFree{true, true, true, true, true, true};
constexpr TangentMask kHeld{};
// A turn about the axis and a shift along it do not change a revolute joint; no shift changes a
// prismatic one.
constexpr TangentMask kRevoluteAxis{true, true, false, true, true, false};
constexpr TangentMask kPrismaticAxis{true, true, false, false, false, false};
constexpr TangentMask kPointMount{false, false, false, true, true, true};

std::map<TagId, int> marker_index(const KinematicTree& tree) {
  std::map<TagId, int> index;
  for (std::size_t m = 0; m < tree.markers.size(); ++m) {
    index[tree.markers[m].id] = static_cast<int>(m);
  }
  return index;
}

void add_corners(const Measurements& measurements, const MarkerSet& markers, Spec& spec) {
  const auto index = marker_index(spec.tree);
  for (const TagObservation& observation : measurements.corners) {
    const auto found = index.find(observation.id);
    if (found == index.end()) continue;
    Sighting sighting;
    sighting.kind = MeasurementKind::kCorners;
    sighting.frame = observation.frame;
    sighting.marker = found->second;
    sighting.corners_px = observation.corners_px;
    sighting.geometry_m = markers.corners_m(observation.id);
    sighting.sigma = observation.sigma_px;
    sighting.declared_sigma = sighting.sigma;
    KINESCOPE_CHECK(sighting.corners_px.size() == sighting.geometry_m.size(),
                    "as many corners as the marker has");
    spec.sightings.push_back(std::move(sighting));
  }
}

// The last three rows are of the translation alone and at right angles to one another, so that
// their lengths say what a residual is in metres.
Matrix6d whitening_of(const Matrix6d& covariance) {
  const Eigen::LLT<Matrix6d> factor(covariance.inverse());
  KINESCOPE_CHECK(factor.info() == Eigen::Success, "a pose's covariance is positive definite");
  Matrix6d out = factor.matrixU();
  const Eigen::Matrix3d U = out.bottomRightCorner<3, 3>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(U.transpose() * U);
  out.bottomRightCorner<3, 3>() =
      axes.eigenvalues().cwiseSqrt().asDiagonal() * axes.eigenvectors().transpose();
  return out;
}

void add_poses(const Measurements& measurements, Spec& spec) {
  const auto index = marker_index(spec.tree);
  for (const PoseTrack& track : measurements.poses.tracks) {
    const auto found = index.find(track.id);
    if (found == index.end()) continue;
    for (const PoseSample& sample : track.samples) {
      Sighting sighting;
      sighting.kind = MeasurementKind::kPose;
      sighting.frame = sample.frame;
      sighting.marker = found->second;
      sighting.T_camera_marker = sample.T_camera_marker;
      sighting.whitening = whitening_of(sample.covariance);
      spec.sightings.push_back(std::move(sighting));
    }
  }
}

void add_points(const Measurements& measurements, Spec& spec) {
  const auto index = marker_index(spec.tree);
  std::map<std::string, int> targets;
  for (const PointObservation& observation : measurements.points.observations) {
    if (!observation.position_m) targets.try_emplace(observation.target, 0);
  }
  for (auto& [name, number] : targets) {
    number = static_cast<int>(spec.targets.size());
    spec.targets.push_back(name);
  }
  for (const PointObservation& observation : measurements.points.observations) {
    const auto found = index.find(observation.id);
    if (found == index.end()) continue;
    Sighting sighting;
    sighting.kind = MeasurementKind::kPoint;
    sighting.frame = observation.frame;
    sighting.marker = found->second;
    sighting.sigma = observation.sigma_m;
    if (observation.position_m) {
      sighting.position_m = *observation.position_m;
    } else {
      sighting.target = targets.at(observation.target);
    }
    spec.sightings.push_back(std::move(sighting));
  }
  for (const TargetDistance& distance : measurements.points.distances) {
    const auto from = targets.find(distance.from);
    const auto to = targets.find(distance.to);
    if (from == targets.end() || to == targets.end()) continue;
    spec.distances.push_back({from->second, to->second, distance.distance_m, distance.sigma_m});
  }
}

// True when nothing measured has a place in the camera's (tracker's) frame.
bool only_targets(const Spec& spec) {
  return spec.kind == MeasurementKind::kPoint &&
         std::ranges::all_of(spec.sightings, [](const Sighting& s) { return s.target >= 0; });
}

// Readings in rad or m, deg, mm: the unit is known, and a scale beside it would be an effect of the
// robot.
bool is_unit_scale(double scale) {
  return scale == 1.0 || scale == kRadPerDegree || scale == kMetrePerMillimetre;
}

void free_joints(const CalibrationStart& start, const CalibrateOptions& options, Spec& spec) {
  for (std::size_t j = 0; j < spec.tree.joints.size(); ++j) {
    const Joint& joint = spec.tree.joints[j];
    TangentMask mask = kHeld;
    if (options.free == FreeGeometry::kGeometry && is_movable(joint)) {
      if (start.nominal) {
        // Zeros belong to a nominal robot's frames; a prior holds what the data leave open. The
        // frame of a joint that stands still is a part of its neighbours'.
        mask = stands_still(spec, j) ? kHeld : kAllFree;
      } else {
        mask = joint.type == JointType::kRevolute ? kRevoluteAxis : kPrismaticAxis;
      }
    }
    spec.free_joint.push_back(mask);
    const bool movable = is_movable(joint);
    const bool driven = spec.channel[j] >= 0;
    // A nominal robot's joint without a channel is held at its offset, unless values are given.
    const bool held = start.nominal && start.joint_values.size() == 0;
    spec.free_value.push_back(movable && !driven && !held);
    const bool own_unit = driven && !is_unit_scale(joint.scale);
    // What follows another joint has its line as drawn.
    const bool follows = std::ranges::count(spec.tree.joints, joint.channel, &Joint::channel) > 1;
    spec.keeps_offset.push_back(start.nominal && movable && own_unit && !follows);
    spec.free_offset.push_back(
        spec.keeps_offset.back() ||
        (start.nominal && movable && driven && options.free == FreeGeometry::kOffsets));
    spec.free_scale.push_back(own_unit || (driven && options.estimate_scales));
  }
}

void hold_robot(Spec& spec) {
  spec.free_joint.assign(spec.free_joint.size(), kHeld);
  spec.free_offset.assign(spec.free_offset.size(), false);
  spec.free_scale.assign(spec.free_scale.size(), false);
  spec.hold_corrections = true;
}

void free_frames(const CalibrationStart& start, Spec& spec) {
  const auto anchor = first_seen_base_marker(spec);
  const bool point = spec.kind == MeasurementKind::kPoint;
  for (std::size_t m = 0; m < spec.tree.markers.size(); ++m) {
    const bool held = !start.nominal && anchor && *anchor == m;
    spec.free_mount.push_back(held ? kHeld : point ? kPointMount : kAllFree);
  }
  const bool base_is_seen = start.nominal ? !only_targets(spec) : anchor.has_value();
  // Beside the reference camera every other one shows where it stands, if it shows anything.
  std::vector<bool> sees(spec.cameras.size(), false);
  for (const Sighting& sighting : spec.sightings)
    sees[static_cast<std::size_t>(sighting.camera)] = true;
  for (std::size_t c = 0; c < spec.cameras.size(); ++c)
    spec.cameras[c].free_pose = (c == 0 ? base_is_seen : sees[c]) ? kAllFree : kHeld;
}

void add_cameras(const Measurements& measurements, const CalibrationStart& start, Spec& spec) {
  spec.cameras.push_back({start.camera_name, start.camera});
  for (const FurtherCamera& camera : start.further_cameras)
    spec.cameras.push_back({camera.name, camera.camera});
  spec.camera_of_frame = measurements.camera_of_frame;
  spec.starts_s = measurements.starts_s;
  KINESCOPE_CHECK(
      spec.camera_of_frame.empty() || spec.camera_of_frame.size() == spec.times_s.size(),
      "a camera for every frame");
  for (const int camera : spec.camera_of_frame) {
    KINESCOPE_CHECK(camera >= 0 && camera < std::ssize(spec.cameras), "every camera has a start");
  }
}

void free_intrinsics(SpecCamera& camera) {
  // k3 bends only the far corners of the image, where markers seldom are: held unless the model
  // needs it.
  const int count = 4 + distortion_count(camera.model.model);
  for (int i = 0; i < count; ++i) camera.free_intrinsics[static_cast<std::size_t>(i)] = true;
  if (camera.model.model == DistortionModel::kPlumbBob) camera.free_intrinsics[8] = false;
}

void add_couplings(const JointLog& log, Spec& spec) {
  spec.couplings.resize(spec.tree.joints.size());
  for (std::size_t j = 0; j < spec.tree.joints.size(); ++j) {
    for (const ChannelShare& share : spec.tree.joints[j].couplings) {
      const auto channel = log.channel(share.channel);
      KINESCOPE_CHECK(channel.has_value(), "a coupled channel is in the log");
      spec.couplings[j].emplace_back(*channel, share.ratio);
    }
  }
}

// From the camera's link up to where the ways part, and down from there.
std::vector<int> path_between(const KinematicTree& tree, LinkId from, LinkId to) {
  std::vector<JointId> up = tree.path_to(from);
  std::vector<JointId> down = tree.path_to(to);
  const auto [up_end, down_end] = std::ranges::mismatch(up, down);
  up.erase(up.begin(), up_end);
  down.erase(down.begin(), down_end);
  std::vector<int> out;
  for (auto joint = up.rbegin(); joint != up.rend(); ++joint) out.push_back(joint->value);
  for (const JointId joint : down) out.push_back(joint.value);
  return out;
}

void add_paths(const CalibrationStart& start, Spec& spec) {
  spec.carried = start.moving && !start.moving->on_robot();
  spec.camera_link = start.moving ? start.moving->link : LinkId{0};
  KINESCOPE_CHECK(!start.moving || spec.cameras.size() == 1, "a camera that moves is the only one");
  KINESCOPE_CHECK(!spec.carried || start.moving->path.size() == spec.times_s.size(),
                  "a camera that is carried has a pose in every frame");
  for (std::size_t l = 0; l < spec.tree.links.size(); ++l)
    spec.path.push_back(path_between(spec.tree, spec.camera_link, LinkId{static_cast<int>(l)}));
  spec.upward.assign(spec.tree.joints.size(), false);
  for (const JointId joint : spec.tree.path_to(spec.camera_link)) spec.upward[joint.index()] = true;
}

// A marker that is alone in its frame says where a carried camera is, and nothing else.
void drop_lone_sightings(const MovingCamera& moving, Spec& spec) {
  std::erase_if(spec.sightings, [&](const Sighting& sighting) {
    return !moving.is_known(static_cast<std::size_t>(sighting.frame));
  });
  std::map<int, int> count;
  for (const Sighting& sighting : spec.sightings) ++count[sighting.frame];
  std::erase_if(spec.sightings,
                [&](const Sighting& sighting) { return count.at(sighting.frame) < 2; });
}

void check_something_seen(const Spec& spec) {
  if (!spec.sightings.empty()) return;
  throw undetermined("calibration", "none of the markers seen belongs to the robot's structure",
                     "check that the markers of tags.yaml are on the robot");
}

}  // namespace

Spec make_spec(const Measurements& measurements, const MarkerSet& markers, const JointLog& log,
               const CalibrationStart& start, const CalibrateOptions& options) {
  Spec spec;
  spec.tree = start.tree;
  spec.times_s = measurements.times_s;
  spec.log = log;
  add_cameras(measurements, start, spec);
  for (const Joint& joint : spec.tree.joints) {
    const auto channel =
        joint.type == JointType::kFixed ? std::nullopt : log.channel(joint.channel);
    spec.channel.push_back(channel.value_or(-1));
  }
  add_couplings(log, spec);
  spec.postures = shows_postures(spec.tree, log, spec.times_s);
  spec.corrections = start.corrections;
  add_paths(start, spec);
  if (!measurements.corners.empty()) {
    spec.kind = MeasurementKind::kCorners;
    add_corners(measurements, markers, spec);
  } else if (!measurements.poses.tracks.empty()) {
    spec.kind = MeasurementKind::kPose;
    add_poses(measurements, spec);
  } else {
    spec.kind = MeasurementKind::kPoint;
    add_points(measurements, spec);
  }
  // The order of the input must not reach the bits of the answer.
  std::ranges::stable_sort(spec.sightings, [](const Sighting& a, const Sighting& b) {
    return std::pair(a.frame, a.marker) < std::pair(b.frame, b.marker);
  });
  for (Sighting& sighting : spec.sightings) {
    if (!spec.camera_of_frame.empty())
      sighting.camera = spec.camera_of_frame[static_cast<std::size_t>(sighting.frame)];
    sighting.series =
        sighting.camera * static_cast<int>(spec.tree.markers.size()) + sighting.marker;
  }
  if (spec.postures) {
    std::erase_if(spec.sightings, [&](const Sighting& sighting) {
      return !is_stamp(log, spec.times_s[static_cast<std::size_t>(sighting.frame)]);
    });
  }
  if (spec.carried) drop_lone_sightings(*start.moving, spec);
  check_something_seen(spec);
  free_joints(start, options, spec);
  if (options.hold_robot) hold_robot(spec);
  free_frames(start, spec);
  spec.free_time_offset = options.estimate_time_offset && !spec.postures && !log.empty();
  if (start.nominal && options.free == FreeGeometry::kGeometry && !options.hold_robot)
    spec.prior = options.nominal;
  for (std::size_t c = 0; c < spec.cameras.size(); ++c) {
    SpecCamera& camera = spec.cameras[c];
    camera.free_lag = c > 0 && camera.free_pose != kHeld && options.estimate_time_offset &&
                      !spec.postures && !log.empty();
    const bool estimate =
        c == 0 ? options.estimate_intrinsics : start.further_cameras[c - 1].estimate_intrinsics;
    const bool is_seen_by = c == 0 || camera.free_pose != kHeld;
    if (estimate && is_seen_by && spec.kind == MeasurementKind::kCorners) free_intrinsics(camera);
  }
  return spec;
}

bool stands_still(const Spec& spec, std::size_t joint) {
  if (spec.channel[joint] < 0 || !spec.couplings[joint].empty()) return false;
  constexpr double kStillRad = 1e-3;
  constexpr double kStillM = 1e-4;
  std::vector<double> values;
  for (const double value : spec.log.values.col(spec.channel[joint]))
    if (std::isfinite(value)) values.push_back(value);
  if (values.size() < 3) return true;
  std::ranges::sort(values);
  const std::size_t last = values.size() - 1;
  const double travel = std::min(values[last] - values[1], values[last - 1] - values[0]) *
                        std::abs(spec.tree.joints[joint].scale);
  return travel < (spec.tree.joints[joint].type == JointType::kRevolute ? kStillRad : kStillM);
}

void guess_targets(const Spec& spec, const std::vector<int>& sightings, State& state) {
  if (spec.targets.empty()) return;
  const Readings readings(spec, state);
  std::vector<Eigen::Vector3d> sum(spec.targets.size(), Eigen::Vector3d::Zero());
  std::vector<int> count(spec.targets.size(), 0);
  for (const int index : sightings) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
    if (sighting.target < 0) continue;
    const auto t = static_cast<std::size_t>(sighting.target);
    sum[t] += predict(spec, state, readings, sighting).translation;
    ++count[t];
  }
  for (std::size_t t = 0; t < sum.size(); ++t) {
    const Eigen::Vector3d mean = sum[t] / std::max(1, count[t]);
    state.targets[t] = {mean.x(), mean.y(), mean.z()};
  }
}

int count_frames(const Spec& spec, const std::vector<int>& sightings) {
  std::set<int> frames;
  for (const int index : sightings) {
    frames.insert(spec.sightings[static_cast<std::size_t>(index)].frame);
  }
  return static_cast<int>(frames.size());
}

std::optional<std::size_t> first_seen_base_marker(const Spec& spec) {
  std::set<int> seen;
  for (const Sighting& sighting : spec.sightings) seen.insert(sighting.marker);
  for (std::size_t m = 0; m < spec.tree.markers.size(); ++m) {
    if (spec.tree.markers[m].link == LinkId{0} && seen.contains(static_cast<int>(m))) return m;
  }
  return std::nullopt;
}

std::string gauge_in_words(const Spec& spec) {
  std::string words;
  if (const auto anchor = first_seen_base_marker(spec);
      anchor && spec.free_mount[*anchor] == kHeld) {
    words = fmt::format("The base frame is held to tag_{}; ", spec.tree.markers[*anchor].id.value);
  } else if (spec.cameras.front().free_pose == kHeld) {
    words = "The base frame is held where it starts; ";
  }
  words +=
      spec.prior
          ? "joint frames stay near the nominal ones by a weak prior where the data are silent. "
            "Uncertainties hold the base frame to its first marker (or the camera, or the targets) "
            "and turn no "
            "frame about its own axis: that is a choice, not a thing to know."
          : "joint frames keep their z axis on the joint's axis and neither turn about nor slide "
            "along it: the markers' and next joints' places take that up, so nothing is lost.";
  return words;
}

}  // namespace kinescope::bundle
