// SPDX-License-Identifier: Apache-2.0
//
// Takes   a folder of a measured recording as others published it (read in place).
// Gives   the same measurements as a recording of ours in another folder (app/io/recording.h).
// Not here: what should come out (real_data.cpp); running it (real_run.h).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "app/io/recording.h"
#include "calib/camera/camera_model.h"

namespace kinescope::real {

/// Two-axis positioner: target poses and both encoders.
[[nodiscard]] RecordingPaths positioner(const std::filesystem::path& data,
                                        const std::filesystem::path& into);
/// Six-axis arm, one joint swept at a time: the flange's pose from three tracker nests.
[[nodiscard]] RecordingPaths laser_sweeps(const std::filesystem::path& data,
                                          const std::filesystem::path& into);
/// A door with one marker: the video itself, or the marker's poses that come with it. No joint log.
[[nodiscard]] RecordingPaths door_video(const std::filesystem::path& data,
                                        const std::filesystem::path& into);
[[nodiscard]] RecordingPaths door_poses(const std::filesystem::path& data,
                                        const std::filesystem::path& into);
/// A chessboard seen from a flange that only shifts (poses 0 to 10); the controller's y and z as
/// log.
[[nodiscard]] RecordingPaths kuka_chessboard(const std::filesystem::path& data,
                                             const std::filesystem::path& into,
                                             const CameraModel& camera);

/// Tags that one rigid body carries, as the set's own description says.
struct TagBody {
  std::string name;
  std::vector<int> tags;
};
/// One camera of a TagSLAM recording: the detector's corners, sizes and camera as declared. No
/// joint log.
[[nodiscard]] RecordingPaths tagslam(const std::filesystem::path& data,
                                     const std::filesystem::path& into, const std::string& topic);
[[nodiscard]] std::vector<TagBody> tagslam_bodies(const std::filesystem::path& data);

/// A ball at the flange held in sockets 50 mm apart. `file` such as "panda_2.csv".
[[nodiscard]] RecordingPaths ball_socket(const std::filesystem::path& data,
                                         const std::filesystem::path& into,
                                         const std::string& file);
/// Camera on the flange of an FR3: its poses in the board's frame.
[[nodiscard]] RecordingPaths franka_fr3(const std::filesystem::path& data,
                                        const std::filesystem::path& into);
/// Right arm of a two-arm robot on a turntable: the tracker's points.
[[nodiscard]] RecordingPaths motoman_tracker(const std::filesystem::path& data,
                                             const std::filesystem::path& into);
/// UR10: tool poses seen by a fixed camera.
[[nodiscard]] RecordingPaths ur10_chessboard(const std::filesystem::path& data,
                                             const std::filesystem::path& into);
/// Mover6: tool tag in the base tag's frame.
[[nodiscard]] RecordingPaths mover6(const std::filesystem::path& data,
                                    const std::filesystem::path& into);

}  // namespace kinescope::real
