// SPDX-License-Identifier: Apache-2.0
//
// Takes   a World: exact corners of every frame, with whatever effects are in them.
// Gives   the recording that a user would have of it: video.mp4 (H.264), joints.csv, camera.yaml,
//         tags.yaml.
// Method  every tag is drawn through the homography of its corners in undistorted coordinates, at
//         three instants of the exposure; nearer tags cover farther ones; uneven light, vignetting,
//         noise of the sensor.
#pragma once

#include <cstdint>
#include <filesystem>

#include "tests/truth/camera_world.h"

namespace kinescope::truth {

struct FilmOptions {
  double frame_rate_hz = 30.0;
  double exposure_s = 0.004;  ///< centred on the stamp
  double blur_px = 0.6;       ///< standard deviation, of the lens
  double noise = 2.0;         ///< grey levels
  int crf = 18;               ///< of H.264: less is better
  std::uint64_t seed = 1;     ///< of the noise
};

/// Writes into a folder that exists. Needs the ffmpeg program: throws std::runtime_error without
/// it.
void write_recording(const std::filesystem::path& folder, const World& world,
                     const FilmOptions& options);

}  // namespace kinescope::truth
