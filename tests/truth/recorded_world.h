// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include <fmt/format.h>

#include "calib/camera/camera_file.h"
#include "kinematics/core/file.h"
#include "tests/truth/camera_world.h"

namespace kinescope::truth {

/// A world as a recording: corners.csv, joints.csv, camera.yaml and tags.yaml in a folder, which is
/// made.
inline void write_world(const World& world, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  std::string corners = "t,tag,corner,u,v\n";
  for (const TagObservation& seen : world.measurements.corners) {
    for (std::size_t c = 0; c < seen.corners_px.size(); ++c)
      corners += fmt::format("{:.6f},{},{},{:.5f},{:.5f}\n",
                             world.measurements.times_s[static_cast<std::size_t>(seen.frame)],
                             seen.id.value, c, seen.corners_px[c].x(), seen.corners_px[c].y());
  }
  std::string joints = "t";
  for (const std::string& channel : world.log.channels) joints += "," + channel;
  for (std::size_t i = 0; i < world.log.size(); ++i) {
    joints += fmt::format("\n{:.6f}", world.log.times_s[i]);
    for (const double value : world.log.values.row(static_cast<Eigen::Index>(i)))
      joints += fmt::format(",{:.9f}", value);
  }
  write_file_atomically(folder / "corners.csv", corners);
  write_file_atomically(folder / "joints.csv", joints + "\n");
  write_file_atomically(folder / "camera.yaml", write_camera_info(world.camera));
  write_file_atomically(folder / "tags.yaml", fmt::format("family: tag36h11\ndefault_size: {}\n",
                                                          world.markers.default_size_m));
}

}  // namespace kinescope::truth
