// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/real_files.h"

#include <fmt/format.h>

#include "kinematics/core/file.h"
#include "kinematics/urdf/urdf.h"

namespace kinescope::real {
namespace fs = std::filesystem;

void write_text(const fs::path& folder, const std::string& name, const std::string& text) {
  fs::create_directories(folder);
  write_file_atomically(folder / name, text);
}

void write_poses(const fs::path& folder, const std::vector<PoseRow>& rows) {
  std::string out = "t,body,x,y,z,qx,qy,qz,qw,sigma_m,sigma_rad\n";
  const auto sigma = [](double value) { return value > 0.0 ? fmt::format("{}", value) : ""; };
  for (const PoseRow& row : rows) {
    const Eigen::Vector3d& p = row.pose.translation;
    const Eigen::Quaterniond& q = row.pose.rotation;
    out += fmt::format("{},{},{},{},{},{},{},{},{},{},{}\n", row.time_s, row.body, p.x(), p.y(),
                       p.z(), q.x(), q.y(), q.z(), q.w(), sigma(row.sigma_m), sigma(row.sigma_rad));
  }
  write_text(folder, "poses.csv", out);
}

void write_points(const fs::path& folder, const std::vector<PointRow>& rows) {
  std::string out = "t,point,x,y,z,target\n";
  for (const PointRow& row : rows) {
    const Eigen::Vector3d& p = row.position_m;
    out += row.target.empty()
               ? fmt::format("{},{},{},{},{},\n", row.time_s, row.point, p.x(), p.y(), p.z())
               : fmt::format("{},{},,,,{}\n", row.time_s, row.point, row.target);
  }
  write_text(folder, "points.csv", out);
}

void write_corners(const fs::path& folder, const std::vector<CornersRow>& rows) {
  std::string out = "t,tag,corner,u,v\n";
  for (const CornersRow& row : rows) {
    for (std::size_t c = 0; c < row.corners_px.size(); ++c) {
      out += fmt::format("{},{},{},{},{}\n", row.time_s, row.tag, c, row.corners_px[c].x(),
                         row.corners_px[c].y());
    }
  }
  write_text(folder, "corners.csv", out);
}

void write_joints(const fs::path& folder, const std::vector<double>& times_s,
                  const std::vector<std::string>& names, const Eigen::MatrixXd& values) {
  std::string out = "t";
  for (const std::string& name : names) out += "," + name;
  out += '\n';
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    out += fmt::format("{}", times_s[i]);
    for (Eigen::Index c = 0; c < values.cols(); ++c) {
      out += fmt::format(",{}", values(static_cast<Eigen::Index>(i), c));
    }
    out += '\n';
  }
  write_text(folder, "joints.csv", out);
}

// camera_info, written here so that a converter does not lean on the writer under test.
void write_camera(const fs::path& folder, const CameraModel& camera) {
  std::string distortion;
  for (int i = 0; i < distortion_count(camera.model); ++i) {
    distortion +=
        fmt::format("{}{}", i == 0 ? "" : ", ", camera.distortion[static_cast<std::size_t>(i)]);
  }
  write_text(folder, "camera.yaml",
             fmt::format("image_width: {}\nimage_height: {}\ncamera_name: camera\n"
                         "camera_matrix:\n  rows: 3\n  cols: 3\n"
                         "  data: [{}, 0, {}, 0, {}, {}, 0, 0, 1]\n"
                         "distortion_model: {}\n"
                         "distortion_coefficients:\n  rows: 1\n  cols: {}\n  data: [{}]\n",
                         camera.width, camera.height, camera.fx, camera.cx, camera.fy, camera.cy,
                         to_string(camera.model), distortion_count(camera.model), distortion));
}

void write_nominal(const fs::path& folder, const KinematicTree& tree) {
  write_text(folder, "nominal.urdf", write_urdf(tree));
}

double Columns::number(std::size_t row, const std::string& name) const {
  return table_.number(row, table_.require_column(name));
}

const std::string& Columns::text(std::size_t row, const std::string& name) const {
  return table_.rows[row][table_.require_column(name)];
}

Eigen::Vector3d Columns::vector3(std::size_t row, const std::string& prefix) const {
  return {number(row, prefix + "x_m"), number(row, prefix + "y_m"), number(row, prefix + "z_m")};
}

Pose Columns::pose(std::size_t row, const std::string& prefix) const {
  const Eigen::Quaterniond q(number(row, prefix + "qw"), number(row, prefix + "qx"),
                             number(row, prefix + "qy"), number(row, prefix + "qz"));
  return {q.normalized(), vector3(row, prefix)};
}

Eigen::MatrixXd Columns::matrix(const std::vector<std::string>& names) const {
  Eigen::MatrixXd out(static_cast<Eigen::Index>(rows()), static_cast<Eigen::Index>(names.size()));
  for (std::size_t r = 0; r < rows(); ++r) {
    for (std::size_t c = 0; c < names.size(); ++c) {
      out(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) = number(r, names[c]);
    }
  }
  return out;
}

}  // namespace kinescope::real
