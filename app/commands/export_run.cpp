// SPDX-License-Identifier: Apache-2.0
//
// A finished run as `kinescope export` needs it: where links and camera were in every frame.
#include <limits>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "app/commands/export_form.h"
#include "kinematics/core/csv.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

Pose unknown_pose() {
  constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();
  return {Eigen::Quaterniond::Identity(), Eigen::Vector3d::Constant(kNotKnown)};
}

// camera_path.csv: T_base_camera by the stamp of its frame.
std::map<double, Pose> read_camera_path(const fs::path& path) {
  constexpr double kUnitLength = 1e-6;  // digits of the file
  const CsvTable table = read_csv(path);
  std::vector<std::size_t> columns;
  for (const char* name : {"t", "x", "y", "z", "qx", "qy", "qz", "qw"})
    columns.push_back(table.require_column(name));
  std::map<double, Pose> out;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    std::vector<double> v;
    for (const std::size_t column : columns) v.push_back(table.number(row, column));
    Pose pose{Eigen::Quaterniond(v[7], v[4], v[5], v[6]), {v[1], v[2], v[3]}};
    if (std::abs(pose.rotation.norm() - 1.0) > kUnitLength) {
      throw bad_input(table.place(row), "the quaternion's length is not 1",
                      "run the recording again");
    }
    pose.rotation.normalize();
    out[v[0]] = pose;
  }
  return out;
}

void place_camera(RecordedRun& out) {
  const Calibration& calibration = out.run.calibration;
  const std::size_t frames = out.joints.times_s.size();
  if (!calibration.moving) {
    out.T_base_camera.assign(frames, calibration.T_camera_base.inverse());
    return;
  }
  if (calibration.moving->on_robot()) {
    const Pose T_link_camera = calibration.moving->T_camera_link.inverse();
    for (const std::vector<Pose>& links : out.T_base_link)
      out.T_base_camera.push_back(links[calibration.moving->link.index()] * T_link_camera);
    return;
  }
  const fs::path file = out.run.folder / "camera_path.csv";
  const std::map<double, Pose> path = read_camera_path(file);
  out.inputs.push_back(file);
  for (const double t : out.joints.times_s) {
    const auto found = path.find(t);
    out.T_base_camera.push_back(found == path.end() ? unknown_pose() : found->second);
  }
}

}  // namespace

RecordedRun read_recorded_run(const fs::path& source, std::string_view option) {
  std::error_code error;
  if (fs::exists(source, error) && !fs::is_directory(source, error)) {
    throw bad_request(option, fmt::format("{} is no folder of a run", source.string()),
                      "give the folder of a finished kinescope run");
  }
  RecordedRun out;
  out.run = read_stored_run(source);
  const fs::path joints = source / "joint_values.csv";
  out.joints = read_joint_values(joints, out.run.calibration);
  out.inputs = {source / "calibration.json", joints};
  for (Eigen::Index f = 0; f < out.joints.values.rows(); ++f) {
    out.T_base_link.push_back(
        forward_kinematics(out.run.calibration.tree, out.joints.values.row(f).transpose()));
  }
  place_camera(out);
  return out;
}

}  // namespace kinescope
