// SPDX-License-Identifier: Apache-2.0
#include "calib/design/planned_robot.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "calib/effects/camera_effects.h"
#include "calib/effects/joint_shares.h"

namespace kinescope::design {
namespace {

// Apart by more than what counts as a motion (kMaxGap).
constexpr double kBetweenPostures_s = 1.0;
// Rows of the log of a motion to be; and s that it goes on at rest before and after.
constexpr double kLogRate_hz = 200.0;
constexpr double kRest_s = 1.0;

JointLog empty_log(const JointSpace& space) {
  JointLog out;
  out.channels = space.channels();
  return out;
}

// The joints at the frames' times.
JointMotion motion_at(const ExpectedRecording& recording, const KinematicTree& tree) {
  JointLog at_frames = recording.log;
  at_frames.times_s = recording.measurements.times_s;
  if (!recording.postures) at_frames.values = resample(recording.log, at_frames.times_s);
  JointMotion out = effects::motion_of(at_frames, tree);
  return out;
}

effects::EffectWorld world_of(const PlannedRobot& robot, const ExpectedRecording& recording) {
  effects::EffectWorld world;
  world.tree = robot.calibration.tree;
  world.cameras = {{"", robot.calibration.camera}};
  world.kind = MeasurementKind::kCorners;
  world.postures = recording.postures;
  for (std::size_t j = 0; j < world.tree.joints.size(); ++j)
    if (recording.log.channel(world.tree.joints[j].channel))
      world.driven.push_back(static_cast<int>(j));
  world.moving = world.driven;
  for (std::size_t m = 0; m < world.tree.markers.size(); ++m) {
    world.seen.push_back(static_cast<int>(m));
    world.seen_by[static_cast<int>(m)] = {0};
  }
  world.frames = motion_at(recording, world.tree);
  world.loaded = world.frames;
  world.log = effects::motion_of(recording.log, world.tree);
  world.gravity_base = robot.gravity_base;
  world.first_s = world.frames.times_s.front();
  world.last_s = world.frames.times_s.back();
  world.clock_free = true;
  world.known = true;
  return world;
}

void add_corrections(const PlannedRobot& robot, ExpectedRecording& recording) {
  for (const auto* effects : {&robot.effects, &robot.rivals})
    for (const ConsideredEffect& effect : *effects)
      std::ranges::move(corrections_of(robot, recording, effect),
                        std::back_inserter(recording.corrections));
}

// In the next of so many frames.
void see(const PlannedRobot& robot, const JointSpace& space, const Eigen::VectorXd& readings,
         std::size_t frames, Measurements& measurements) {
  const double alike_px = robot.noise.all_px * std::sqrt(static_cast<double>(frames));
  const auto frame = static_cast<int>(measurements.times_s.size()) - 1;
  for (TagObservation& seen :
       expected_sightings(robot.calibration, space.values(readings), robot.sight, robot.noise)) {
    seen.frame = frame;
    if (robot.noise.at_rest.contains(seen.id)) seen.sigma_px = alike_px;
    measurements.corners.push_back(std::move(seen));
  }
}

// Shares are divided by what is largest in their own recording; parameters mean one reference.
void in_units_of(double reference, Correction& correction) {
  const double factor = correction.reference / reference;
  correction.reference = reference;
  if (correction.twists.rows() > 0) {
    correction.twists *= factor;
  } else if (correction.share.size() > 0) {
    correction.share *= factor;
  } else {
    correction.direction *= factor;
  }
}

}  // namespace

ExpectedRecording recording_at(const PlannedRobot& robot, const JointSpace& space,
                               const std::vector<Eigen::VectorXd>& postures) {
  ExpectedRecording out;
  out.postures = true;
  out.log = empty_log(space);
  out.log.values.resize(std::ssize(postures), std::ssize(space.channels()));
  for (std::size_t i = 0; i < postures.size(); ++i) {
    const double time_s = kBetweenPostures_s * static_cast<double>(i);
    out.log.times_s.push_back(time_s);
    out.log.values.row(static_cast<Eigen::Index>(i)) = postures[i];
    out.measurements.times_s.push_back(time_s);
    see(robot, space, postures[i], postures.size(), out.measurements);
  }
  add_corrections(robot, out);
  return out;
}

ExpectedRecording recording_along(const PlannedRobot& robot, const JointSpace& space,
                                  const RestToRestPath& path, double frame_rate_hz) {
  ExpectedRecording out;
  out.log = empty_log(space);
  const auto rows =
      static_cast<Eigen::Index>(std::ceil((path.duration_s() + 2.0 * kRest_s) * kLogRate_hz)) + 1;
  out.log.values.resize(rows, std::ssize(space.channels()));
  for (Eigen::Index i = 0; i < rows; ++i) {
    out.log.times_s.push_back(static_cast<double>(i) / kLogRate_hz - kRest_s);
    out.log.values.row(i) = path.readings(out.log.times_s.back());
  }
  const auto frames = static_cast<int>(std::floor(path.duration_s() * frame_rate_hz)) + 1;
  for (int f = 0; f < frames; ++f) {
    out.measurements.times_s.push_back(f / frame_rate_hz);
    see(robot, space, path.readings(f / frame_rate_hz), static_cast<std::size_t>(frames),
        out.measurements);
  }
  add_corrections(robot, out);
  return out;
}

std::vector<Correction> corrections_of(const PlannedRobot& robot,
                                       const ExpectedRecording& recording,
                                       const ConsideredEffect& effect) {
  const effects::EffectWorld world = world_of(robot, recording);
  std::vector<effects::CameraEffect> library = effects::joint_effects(world);
  std::ranges::move(effects::camera_effects(world), std::back_inserter(library));
  for (const effects::CameraEffect& one : library) {
    if (one.candidate.id != effect.id || one.is_time_offset || !one.corrections) continue;
    const std::vector<double>& scan = one.candidate.scan;
    if (one.candidate.scan_listed && std::ranges::find(scan, effect.scan) == scan.end()) return {};
    std::vector<Correction> out = one.corrections(effect.scan);
    const bool is_known = effect.values.size() == std::ssize(out);
    for (std::size_t k = 0; k < out.size(); ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      in_units_of(is_known ? effect.references[at] : 1.0, out[k]);
      if (is_known) out[k].value = effect.values[at];
    }
    return out;
  }
  return {};
}

}  // namespace kinescope::design
