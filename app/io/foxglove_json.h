// SPDX-License-Identifier: Apache-2.0
//
// Messages that viewers of MCAP know by their schema's name (https://docs.foxglove.dev, message
// schemas), as JSON with JSON Schemas. m, s; quaternions of `T_parent_child`.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "kinematics/bags/mcap_writer.h"
#include "kinematics/core/pose.h"

namespace kinescope::foxglove {

/// Channels by what they carry, with their schemas.
[[nodiscard]] bags::McapChannel frame_transforms_channel(const std::string& topic);
[[nodiscard]] bags::McapChannel scene_channel(const std::string& topic);
[[nodiscard]] bags::McapChannel camera_calibration_channel(const std::string& topic);
[[nodiscard]] bags::McapChannel log_channel(const std::string& topic);
/// Numbers under names: a timestamp, and an object of numbers for each of `groups`.
[[nodiscard]] bags::McapChannel numbers_channel(const std::string& topic, const std::string& schema,
                                                const std::vector<std::string>& groups);

struct FrameTransform {
  std::string parent, child;
  Pose T_parent_child;
};

[[nodiscard]] nlohmann::json timestamp(std::uint64_t time_ns);
/// foxglove.FrameTransforms.
[[nodiscard]] nlohmann::json frame_transforms(std::uint64_t time_ns,
                                              const std::vector<FrameTransform>& transforms);

/// A thin plate with its name, fixed to a frame.
struct Plate {
  std::string frame, name;
  Pose T_frame_plate;
  double edge_m = 0.0;
};
/// foxglove.SceneUpdate; the plates stay for ever.
[[nodiscard]] nlohmann::json plates(std::uint64_t time_ns, const std::vector<Plate>& plates);

/// foxglove.Log at level INFO.
[[nodiscard]] nlohmann::json log_message(std::uint64_t time_ns, const std::string& text);

}  // namespace kinescope::foxglove
