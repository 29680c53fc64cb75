// SPDX-License-Identifier: Apache-2.0
//
// Sets without a nominal robot: the structure is to be found.
#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include "tests/experiments/real_files.h"
#include "tests/experiments/real_sets.h"

namespace kinescope::real {
namespace fs = std::filesystem;
namespace {

constexpr double kMillimetre = 1e-3;

std::vector<double> times_of(const std::vector<PoseRow>& rows) {
  std::vector<double> times;
  for (const PoseRow& row : rows) times.push_back(row.time_s);
  return times;
}

// Three points that keep their distances: the frame in their middle, x to the first, z their
// normal.
Pose frame_of_points(const Eigen::Matrix3d& points) {
  const Eigen::Vector3d middle = points.rowwise().mean();
  const Eigen::Vector3d x = (points.col(0) - middle).normalized();
  const Eigen::Vector3d z = x.cross(points.col(1) - middle).normalized();
  Eigen::Matrix3d R;
  R << x, z.cross(x), z;
  return {Eigen::Quaterniond(R), middle};
}

// Rigid fit of the mean triangle to each posture's three points (Umeyama 1991).
std::vector<Pose> fit_triangles(const std::vector<Eigen::Matrix3d>& triangles) {
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  for (const Eigen::Matrix3d& points : triangles) {
    const Pose frame = frame_of_points(points);
    for (int i = 0; i < 3; ++i) {
      mean.col(i) +=
          frame.inverse() * Eigen::Vector3d(points.col(i)) / static_cast<double>(triangles.size());
    }
  }
  std::vector<Pose> poses;
  for (const Eigen::Matrix3d& points : triangles) {
    poses.push_back(pose_from_matrix(Eigen::umeyama(mean, points, false)));
  }
  return poses;
}

}  // namespace

RecordingPaths positioner(const fs::path& data, const fs::path& into) {
  const Columns table(data / "measurements.csv");
  std::vector<PoseRow> poses;
  const double begin = table.number(0, "stamp_unix_s");
  for (std::size_t r = 0; r < table.rows(); ++r) {
    poses.push_back(
        {table.number(r, "stamp_unix_s") - begin, 0, table.pose(r, "cam_T_target_"), 0.0, 0.0});
  }
  write_poses(into, poses);
  write_joints(into, times_of(poses), {"joint_1", "joint_2"},
               table.matrix({"joint_1_rad", "joint_2_rad"}));
  return in_folder(into);
}

RecordingPaths laser_sweeps(const fs::path& data, const fs::path& into) {
  constexpr double kPointSigma =
      0.04 * kMillimetre;  // instrument, from the constancy of the distances
  const Columns table(data / "sweeps.csv");
  std::vector<Eigen::Matrix3d> triangles;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    Eigen::Matrix3d points;
    for (int n = 0; n < 3; ++n) {
      const std::string nest = fmt::format("n{}_", n + 1);
      points.col(n) = kMillimetre * Eigen::Vector3d(table.number(r, nest + "x_mm"),
                                                    table.number(r, nest + "y_mm"),
                                                    table.number(r, nest + "z_mm"));
    }
    triangles.push_back(points);
  }
  // Of the middle of three points, and of a turn averaged over the axes: the sum of the squared
  // arms about an axis is two thirds of the sum of the squared distances from the middle.
  const Eigen::Matrix3d& points = triangles.front();
  const double arms = (points.colwise() - points.rowwise().mean()).squaredNorm();
  const double sigma_m = kPointSigma / std::sqrt(3.0);
  const double sigma_rad = kPointSigma / std::sqrt(arms * 2.0 / 3.0);
  const std::vector<Pose> frames = fit_triangles(triangles);
  std::vector<PoseRow> poses;
  for (std::size_t r = 0; r < frames.size(); ++r) {
    poses.push_back({static_cast<double>(r), 0, frames[r], sigma_m, sigma_rad});
  }
  write_poses(into, poses);
  write_joints(
      into, times_of(poses), {"j1", "j2", "j3", "j4", "j5", "j6"},
      kRadPerDegree * table.matrix({"j1_deg", "j2_deg", "j3_deg", "j4_deg", "j5_deg", "j6_deg"}));
  return in_folder(into);
}

RecordingPaths door_video(const fs::path& data, const fs::path& into) {
  write_text(into, "tags.yaml", "family: DICT_6X6_250\nsizes:\n  1: 0.141\nonly_listed: true\n");
  RecordingPaths paths = in_folder(into);
  paths.video = data / "door.mp4";
  paths.camera = data / "camera_calib.xml";
  return paths;
}

RecordingPaths door_poses(const fs::path& data, const fs::path& into) {
  const Columns table(data / "derived_marker1_track.csv");
  std::vector<PoseRow> poses;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    poses.push_back({table.number(r, "t_s"), 1, table.pose(r, "cam_T_tag_"), 0.0, 0.0});
  }
  write_poses(into, poses);
  return in_folder(into);
}

RecordingPaths kuka_chessboard(const fs::path& data, const fs::path& into,
                               const CameraModel& camera) {
  constexpr int kLast = 10;  // poses 0 to 10 have one orientation
  const Columns corners(data / "derived_corners.csv");
  std::vector<CornersRow> rows;
  for (std::size_t r = 0; r < corners.rows(); ++r) {
    const int index = static_cast<int>(corners.number(r, "index"));
    if (index > kLast) continue;
    if (rows.empty() || rows.back().time_s != index)
      rows.push_back({static_cast<double>(index), 0, {}});
    rows.back().corners_px.emplace_back(corners.number(r, "u_px"), corners.number(r, "v_px"));
  }
  write_corners(into, rows);
  const Columns robot(data / "robot_poses.csv");
  std::vector<double> times;
  for (int i = 0; i <= kLast; ++i) times.push_back(i);
  write_joints(into, times, {"flange_y", "flange_z"},
               robot.matrix({"base_T_flange_y_m", "base_T_flange_z_m"}).topRows(kLast + 1));
  write_camera(into, camera);
  write_text(into, "tags.yaml", "boards:\n  0: {columns: 28, rows: 17, square: 0.02}\n");
  return in_folder(into);
}

RecordingPaths tagslam(const fs::path& data, const fs::path& into, const std::string& topic) {
  constexpr double kHalfPixel = 0.5;  // the detector counts from the corner of the first pixel
  const Columns table(data / "tag_corners.csv");
  std::vector<CornersRow> rows;
  const double begin = table.number(0, "stamp_s");
  for (std::size_t r = 0; r < table.rows(); ++r) {
    if (table.text(r, "topic") != topic) continue;
    CornersRow row{
        table.number(r, "stamp_s") - begin, static_cast<int>(table.number(r, "tag_id")), {}};
    for (int c = 0; c < 4; ++c) {
      row.corners_px.emplace_back(table.number(r, fmt::format("u{}", c)) - kHalfPixel,
                                  table.number(r, fmt::format("v{}", c)) - kHalfPixel);
    }
    rows.push_back(std::move(row));
  }
  write_corners(into, rows);
  std::string sizes;
  for (const YAML::Node& entry : YAML::LoadFile((data / "tagslam.yaml").string())["bodies"]) {
    const YAML::Node body = entry.begin()->second;
    for (const YAML::Node& tag : body["tags"]) {
      sizes += fmt::format("  {}: {}\n", tag["id"].as<int>(), tag["size"].as<double>());
    }
    if (const YAML::Node board = body["board"]) {
      const int count = board["tag_rows"].as<int>() * board["tag_columns"].as<int>();
      for (int i = 0; i < count; ++i) {
        sizes += fmt::format("  {}: {}\n", board["tag_start_id"].as<int>() + i,
                             board["tag_size"].as<double>());
      }
    }
  }
  write_text(into, "tags.yaml", "family: tag36h11\nonly_listed: true\nsizes:\n" + sizes);
  RecordingPaths paths = in_folder(into);
  paths.camera = data / "cameras.yaml";
  return paths;
}

std::vector<TagBody> tagslam_bodies(const fs::path& data) {
  std::vector<TagBody> bodies;
  for (const YAML::Node& entry : YAML::LoadFile((data / "tagslam.yaml").string())["bodies"]) {
    TagBody body{entry.begin()->first.as<std::string>(), {}};
    for (const YAML::Node& tag : entry.begin()->second["tags"]) {
      body.tags.push_back(tag["id"].as<int>());
    }
    if (const YAML::Node board = entry.begin()->second["board"]) {
      const int count = board["tag_rows"].as<int>() * board["tag_columns"].as<int>();
      for (int i = 0; i < count; ++i) body.tags.push_back(board["tag_start_id"].as<int>() + i);
    }
    if (!body.tags.empty()) bodies.push_back(std::move(body));
  }
  return bodies;
}

}  // namespace kinescope::real
