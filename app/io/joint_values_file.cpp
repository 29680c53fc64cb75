// SPDX-License-Identifier: Apache-2.0
#include "app/io/joint_values_file.h"

#include <cmath>
#include <iterator>
#include <limits>
#include <set>

#include <fmt/format.h>

#include "app/io/table_cell.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr const char* kJointValuesRemedy = "run the recording again";

// Of the joints that move, in the order of the tree.
std::vector<std::size_t> moving_columns(const KinematicTree& tree) {
  std::vector<std::size_t> out;
  for (std::size_t j = 0; j < tree.joints.size(); ++j)
    if (is_movable(tree.joints[j])) out.push_back(j);
  return out;
}

// A name that a table can have, no two alike.
std::string column_name(const std::string& name, std::set<std::string>& taken) {
  std::string out = table_cell(name);
  while (out.empty() || !taken.insert(out).second) out += '_';
  return out;
}

// Rows of the camera (or recording) that the calibration's own numbers are of.
std::vector<std::size_t> rows_of_reference(const CsvTable& table, const Calibration& calibration) {
  auto column = table.column("camera");
  if (!column) column = table.column("recording");
  const bool several = column == std::size_t{0} && !calibration.camera_name.empty();
  std::vector<std::size_t> out;
  for (std::size_t row = 0; row < table.rows.size(); ++row)
    if (!several || table.rows[row][0] == calibration.camera_name) out.push_back(row);
  if (!out.empty()) return out;
  throw bad_input(table.source, "it has no row", kJointValuesRemedy);
}

void require_increasing(const CsvTable& table, const std::vector<std::size_t>& rows,
                        const std::vector<double>& times_s) {
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    if (times_s[i] > times_s[i - 1]) continue;
    throw bad_input(table.place(rows[i]), "t does not increase", kJointValuesRemedy);
  }
}

}  // namespace

std::string joint_values_csv(const Calibration& calibration) {
  const KinematicTree& tree = calibration.tree;
  const bool several = calibration.cameras() > 1;
  std::string out = several ? (calibration.of_recordings() ? "recording,t" : "camera,t") : "t";
  std::set<std::string> taken{"t", "camera", "recording"};
  for (const std::size_t j : moving_columns(tree))
    out += "," + column_name(tree.joints[j].name, taken);
  out += '\n';
  for (Eigen::Index f = 0; f < calibration.corrected_values.rows(); ++f) {
    const int frame = static_cast<int>(f);
    if (several) out += calibration.name_of_camera(calibration.camera_at(frame)) + ",";
    fmt::format_to(std::back_inserter(out), "{}", calibration.own_time_s(frame));
    for (const std::size_t j : moving_columns(tree)) {
      const double value = calibration.corrected_values(f, static_cast<Eigen::Index>(j));
      out += ',';
      if (std::isfinite(value)) fmt::format_to(std::back_inserter(out), "{}", value);
    }
    out += '\n';
  }
  return out;
}

JointValues read_joint_values(const std::filesystem::path& path, const Calibration& calibration) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    throw bad_input(path.parent_path().string(),
                    "holds no joint_values.csv: an earlier version made the run",
                    kJointValuesRemedy);
  }
  const CsvTable table = read_csv(path);
  const KinematicTree& tree = calibration.tree;
  const std::vector<std::size_t> rows = rows_of_reference(table, calibration);
  const std::size_t time = table.require_column("t");
  JointValues out;
  for (const std::size_t row : rows) out.times_s.push_back(table.number(row, time));
  require_increasing(table, rows, out.times_s);
  out.values = Eigen::MatrixXd::Zero(std::ssize(rows), std::ssize(tree.joints));
  const std::vector<std::size_t> joints = moving_columns(tree);
  std::set<std::string> taken{"t", "camera", "recording"};
  bool as_written = table.header.size() == time + 1 + joints.size();
  for (std::size_t k = 0; as_written && k < joints.size(); ++k)
    as_written = table.header[time + 1 + k] == column_name(tree.joints[joints[k]].name, taken);
  if (!as_written) {
    throw bad_input(fmt::format("{}:{}", table.source, table.header_line),
                    fmt::format("its columns are not t and the robot's {} joints", joints.size()),
                    kJointValuesRemedy);
  }
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const std::size_t j = joints[k], column = time + 1 + k;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      out.values(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          table.optional_number(rows[i], column).value_or(std::numeric_limits<double>::quiet_NaN());
    }
  }
  return out;
}

}  // namespace kinescope
