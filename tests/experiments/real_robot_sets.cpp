// SPDX-License-Identifier: Apache-2.0
//
// Sets with joint values and a nominal robot.
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/file.h"
#include "tests/experiments/real_files.h"
#include "tests/experiments/real_robots.h"
#include "tests/experiments/real_sets.h"

namespace kinescope::real {
namespace fs = std::filesystem;
namespace {

std::vector<std::string> numbered(const std::string& prefix, int count) {
  std::vector<std::string> names;
  for (int i = 1; i <= count; ++i) names.push_back(fmt::format("{}{}", prefix, i));
  return names;
}

std::vector<std::string> with_suffix(std::vector<std::string> names, const std::string& suffix) {
  for (std::string& name : names) name += suffix;
  return names;
}

// Postures are numbered instead of timed.
std::vector<double> count_up(std::size_t rows) {
  std::vector<double> times;
  for (std::size_t r = 0; r < rows; ++r) times.push_back(static_cast<double>(r));
  return times;
}

}  // namespace

RecordingPaths ball_socket(const fs::path& data, const fs::path& into, const std::string& file) {
  const Columns table(data / file);
  std::vector<PointRow> points;
  std::map<std::string, std::vector<std::string>> sockets;  // of each place
  for (std::size_t r = 0; r < table.rows(); ++r) {
    const std::string place = table.text(r, "tool_place");
    const std::string target = fmt::format("{}_{}", place, table.text(r, "socket"));
    std::vector<std::string>& known = sockets[place];
    if (std::ranges::find(known, target) == known.end()) known.push_back(target);
    points.push_back({static_cast<double>(r), 0, {}, target});
  }
  write_points(into, points);
  const std::vector<std::string> joints = numbered("q", 7);
  write_joints(into, count_up(table.rows()), joints, table.matrix(with_suffix(joints, "_rad")));
  std::string distances;
  for (const auto& [place, names] : sockets) {
    if (names.size() != 2) continue;
    distances += fmt::format("  - {{from: {}, to: {}, distance: 0.05}}\n", names[0], names[1]);
  }
  write_text(into, "recording.yaml", "target_distances:\n" + distances);
  write_nominal(into, file.starts_with("kuka") ? iiwa14(joints) : franka("panda", joints));
  return in_folder(into);
}

RecordingPaths franka_fr3(const fs::path& data, const fs::path& into) {
  const Columns table(data / "measurements.csv");
  std::vector<PoseRow> poses;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    poses.push_back({static_cast<double>(r), 0, table.pose(r, "board_T_camera_"), 0.0, 0.0});
  }
  write_poses(into, poses);
  const std::vector<std::string> joints = numbered("q", 7);
  write_joints(into, count_up(table.rows()), joints, table.matrix(with_suffix(joints, "_rad")));
  write_nominal(into, franka("fr3", joints));
  return in_folder(into);
}

RecordingPaths motoman_tracker(const fs::path& data, const fs::path& into) {
  const Columns table(data / "leica_right_hand_6x6x6.csv");
  const std::vector<std::string> joints{"ext_E",   "right_S", "right_L", "right_U",
                                        "right_R", "right_B", "right_T"};
  const Eigen::MatrixXd all = table.matrix(with_suffix(joints, "_rad"));
  std::vector<PointRow> points;
  std::vector<double> times;
  std::vector<Eigen::Index> kept;
  // One row a posture: the tracker's point is repeated for every marker that the cameras saw.
  for (std::size_t r = 0; r < table.rows(); ++r) {
    const double pose = table.number(r, "pose");
    if (table.empty(r, "leica_x_m") || (!times.empty() && times.back() == pose)) continue;
    points.push_back({pose, 0, table.vector3(r, "leica_"), {}});
    times.push_back(pose);
    kept.push_back(static_cast<Eigen::Index>(r));
  }
  write_points(into, points);
  write_joints(into, times, joints, all(kept, Eigen::all));
  const auto model = nlohmann::json::parse(read_text_file(data / "nominal_model.json"));
  std::vector<DhRow> rows;
  for (const auto& row : model["left_arm_TT_S_L_U_R_B_T"]) {
    rows.push_back(
        {row[0].get<double>(), row[1].get<double>(), row[2].get<double>(), row[3].get<double>()});
  }
  rows.front().alpha = 15.0 * kRadPerDegree;  // "same as left with alpha of the first row +15 deg"
  write_nominal(into, classic_dh("motoman_right", rows, joints));
  return in_folder(into);
}

RecordingPaths ur10_chessboard(const fs::path& data, const fs::path& into) {
  const Columns table(data / "measurements.csv");
  std::vector<PoseRow> poses;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    // Extrinsic x, y, z.
    const Eigen::Quaterniond rotation = exp_rotation({0.0, 0.0, table.number(r, "yaw_z_rad")}) *
                                        exp_rotation({0.0, table.number(r, "pitch_y_rad"), 0.0}) *
                                        exp_rotation({table.number(r, "roll_x_rad"), 0.0, 0.0});
    poses.push_back({static_cast<double>(r), 0, {rotation, table.vector3(r, "")}, 0.0, 0.0});
  }
  write_poses(into, poses);
  const std::vector<std::string> joints{"shoulder_pan_joint", "shoulder_lift_joint",
                                        "elbow_joint",        "wrist_1_joint",
                                        "wrist_2_joint",      "wrist_3_joint"};
  write_joints(into, count_up(table.rows()), joints, table.matrix(with_suffix(joints, "_rad")));
  write_nominal(into, ur10(joints));
  return in_folder(into);
}

RecordingPaths mover6(const fs::path& data, const fs::path& into) {
  const Columns table(data / "measurements.csv");
  std::vector<PoseRow> poses;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    poses.push_back({static_cast<double>(r), 0, table.pose(r, "base_T_tcp_"), 0.0, 0.0});
  }
  write_poses(into, poses);
  const std::vector<std::string> joints = numbered("q", 6);
  write_joints(into, count_up(table.rows()), joints, table.matrix(with_suffix(joints, "_rad")));
  // The author's screw axes as printed, the sixth along z.
  write_nominal(into, from_screws("mover6",
                                  {{{0, 0, 1}, {0, 0, 0}},
                                   {{0, 1, 0}, {0, 0, 0.193}},
                                   {{0, 1, 0}, {0, 0, 0.383}},
                                   {{1, 0, 0}, {0, 0, 0.443}},
                                   {{0, 1, 0}, {0.25, 0, 0.443}},
                                   {{0, 0, 1}, {0.25, 0, 0.443}}},
                                  joints));
  return in_folder(into);
}

}  // namespace kinescope::real
