// SPDX-License-Identifier: Apache-2.0
//
// Worlds of recordings_world.h as the bundle takes several recordings: one after the other.
#pragma once

#include <string>
#include <vector>

#include "calib/bundle/calibrate.h"
#include "calib/tracks/several_cameras.h"
#include "kinematics/core/rng.h"
#include "kinematics/log/join_logs.h"
#include "tests/truth/camera_world.h"

namespace kinescope::truth {

struct JoinedRecordings {
  Measurements measurements;
  JointLog log;
};

/// Each a minute behind the one before.
[[nodiscard]] inline JoinedRecordings joined_recordings(const std::vector<World>& worlds) {
  constexpr double kApart = 60.0;  // s
  JoinedRecordings out;
  out.log = worlds.front().log;
  std::vector<std::vector<double>> times_s;
  double start_s = 0.0;
  for (std::size_t k = 0; k < worlds.size(); ++k) {
    const World& world = worlds[k];
    if (k > 0) {
      start_s = out.log.times_s.back() + kApart - world.log.times_s.front();
      out.log = joined_logs(out.log, world.log, start_s, true);
    }
    std::vector<double>& own = times_s.emplace_back(world.measurements.times_s);
    for (double& t : own) t += start_s;
    out.measurements.starts_s.push_back(start_s);
  }
  const CommonFrames frames = merge_frames(times_s);
  out.measurements.times_s = frames.times_s;
  out.measurements.camera_of_frame = frames.camera_of_frame;
  for (std::size_t k = 0; k < worlds.size(); ++k) {
    for (TagObservation tag : worlds[k].measurements.corners) {
      tag.frame = frames.frame_of[k][static_cast<std::size_t>(tag.frame)];
      out.measurements.corners.push_back(std::move(tag));
    }
  }
  return out;
}

/// The truth moved by about 3 mrad and 3 mm; cameras are called "0", "1", ..
[[nodiscard]] inline CalibrationStart perturbed_starts(const std::vector<World>& worlds,
                                                       std::uint64_t seed) {
  constexpr double kOff = 0.003;  // rad, m
  CalibrationStart start = perturbed_start(worlds.front(), kOff, kOff, seed);
  Rng rng = Rng::from_name("start of further recordings", seed);
  start.camera_name = "0";
  for (std::size_t k = 1; k < worlds.size(); ++k) {
    const Pose off{exp_rotation(rng.normal3(kOff)), rng.normal3(kOff)};
    start.further_cameras.push_back(
        {std::to_string(k), worlds[k].T_camera_base * off, worlds[k].camera, 0.0, false});
  }
  return start;
}

}  // namespace kinescope::truth
