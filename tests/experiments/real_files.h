// SPDX-License-Identifier: Apache-2.0
//
// Writing the files of a recording (app/io/recording.h) from values: what the converters of the
// measured sets have in common.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "app/io/recording.h"
#include "calib/camera/camera_model.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/pose.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope::real {

/// One row of poses.csv. Sigmas of 0 are left to the reader's default.
struct PoseRow {
  double time_s = 0.0;
  int body = 0;
  Pose pose;
  double sigma_m = 0.0;
  double sigma_rad = 0.0;
};

/// One row of points.csv; a target's name in place of a position where the place is unknown.
struct PointRow {
  double time_s = 0.0;
  int point = 0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  std::string target;
};

/// The corners of one marker in one frame, in the order of MarkerSet::corners_m.
struct CornersRow {
  double time_s = 0.0;
  int tag = 0;
  std::vector<Eigen::Vector2d> corners_px;
};

/// A recording that consists of the files of one folder.
[[nodiscard]] inline RecordingPaths in_folder(const std::filesystem::path& folder) {
  RecordingPaths paths;
  paths.folder = folder;
  return paths;
}

void write_poses(const std::filesystem::path& folder, const std::vector<PoseRow>& rows);
void write_points(const std::filesystem::path& folder, const std::vector<PointRow>& rows);
void write_corners(const std::filesystem::path& folder, const std::vector<CornersRow>& rows);
/// `values`: times x names, rad or m.
void write_joints(const std::filesystem::path& folder, const std::vector<double>& times_s,
                  const std::vector<std::string>& names, const Eigen::MatrixXd& values);
void write_camera(const std::filesystem::path& folder, const CameraModel& camera);
void write_nominal(const std::filesystem::path& folder, const KinematicTree& tree);
void write_text(const std::filesystem::path& folder, const std::string& name,
                const std::string& text);

/// Cells of a table by column name.
class Columns {
 public:
  explicit Columns(const std::filesystem::path& path) : table_(read_csv(path)) {}
  [[nodiscard]] std::size_t rows() const { return table_.rows.size(); }
  [[nodiscard]] double number(std::size_t row, const std::string& name) const;
  [[nodiscard]] const std::string& text(std::size_t row, const std::string& name) const;
  [[nodiscard]] bool empty(std::size_t row, const std::string& name) const {
    return text(row, name).empty();
  }
  /// Columns <prefix>x_m, y_m, z_m.
  [[nodiscard]] Eigen::Vector3d vector3(std::size_t row, const std::string& prefix) const;
  /// Columns <prefix>x_m, y_m, z_m, qx, qy, qz, qw.
  [[nodiscard]] Pose pose(std::size_t row, const std::string& prefix) const;
  /// All rows of some columns.
  [[nodiscard]] Eigen::MatrixXd matrix(const std::vector<std::string>& names) const;

 private:
  CsvTable table_;
};

}  // namespace kinescope::real
