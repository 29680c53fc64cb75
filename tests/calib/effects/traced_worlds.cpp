// SPDX-License-Identifier: Apache-2.0
#include "tests/calib/effects/traced_worlds.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "kinematics/core/rng.h"

namespace kinescope {

using truth::EffectWorldOptions;
using truth::InjectedEffect;
using truth::make_effect_world;
using truth::World;

constexpr double kSizeTolerance = 0.1;

EffectWorldOptions filmed(std::vector<InjectedEffect> effects, int frames) {
  EffectWorldOptions options;
  options.seed = 7003;
  options.frames = frames;
  options.frame_rate_hz = frames / 33.0;  // 33 s of motion
  options.sigma_px = kSigma;
  options.effects = std::move(effects);
  return options;
}

CalibrationStart start_of(const World& world) {
  return truth::perturbed_start(world, 0.005, 0.001, 1);
}

CalibrationTrace trace_of(const World& world) {
  return trace_calibration(world.measurements, world.markers, world.log, start_of(world), {});
}

InjectedEffect strong(const std::string& effect, const std::string& place) {
  for (InjectedEffect found : truth::weakest_effects(effect, truth::robot_of(filmed()))) {
    if (truth::place_in_library(found) != place) continue;
    found.size *= 10.0;
    return found;
  }
  throw std::logic_error(effect + " cannot sit on " + place);
}

const CalibrationTrace& clean_trace() {
  static const CalibrationTrace trace = trace_of(make_effect_world(filmed()));
  return trace;
}

std::string answer(const Trace& trace) {
  std::string out = std::string(to_string(trace.verdict)) + ": " + trace.reason;
  for (const TracedEffect& effect : trace.accepted)
    out += "; " + effect.id.effect + " " + effect.id.place;
  return out;
}

bool size_is_right(const TracedEffect& found, double size) {
  const double low = std::min(std::abs(found.interval.low), std::abs(found.interval.high));
  const double high = std::max(std::abs(found.interval.low), std::abs(found.interval.high));
  return (low <= std::abs(size) && std::abs(size) <= high) ||
         std::abs(std::abs(found.size) - std::abs(size)) <= kSizeTolerance * std::abs(size);
}

World tracked(truth::RobotKind kind, int postures, std::vector<InjectedEffect> effects,
              std::uint64_t noise_number) {
  constexpr double kSigmaM = 2e-4;
  constexpr double kSigmaRad = 1e-3;
  EffectWorldOptions options = filmed(std::move(effects), postures);
  options.kind = kind;
  options.frame_rate_hz = 0.4;
  options.log_rate_hz = 50.0;
  options.clock_jitter = 0.0;
  options.poses = true;
  World world = make_effect_world(options);
  const truth::FilmedRobot robot = truth::robot_of(options);
  world.log.times_s = world.measurements.times_s;
  world.log.values.resize(static_cast<Eigen::Index>(world.log.times_s.size()),
                          world.log.values.cols());
  for (Eigen::Index i = 0; i < world.log.values.rows(); ++i) {
    world.log.values.row(i) =
        robot.encoders(world.log.times_s[static_cast<std::size_t>(i)]).transpose();
  }
  Rng rng = Rng::from_name("tracker", noise_number);
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(kSigmaRad), Eigen::Vector3d::Constant(kSigmaM);
  variance = variance.cwiseAbs2().eval();
  for (PoseTrack& track : world.measurements.poses.tracks) {
    for (PoseSample& sample : track.samples) {
      Vector6d noise;
      noise << rng.normal3(kSigmaRad), rng.normal3(kSigmaM);
      sample.T_camera_marker = sample.T_camera_marker * exp_pose(noise);
      sample.covariance = variance.asDiagonal();
    }
  }
  world.measurements.corners.clear();
  return world;
}

}  // namespace kinescope
