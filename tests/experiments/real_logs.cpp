// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/real_logs.h"

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope {

Eigen::MatrixXd columns(const ChannelTable& table, const std::string& prefix, int count) {
  Eigen::MatrixXd out(table.rows(), count);
  for (int j = 0; j < count; ++j) {
    const auto column = table.column(prefix + std::to_string(j + 1));
    KINESCOPE_CHECK(column.has_value(), "the set has the columns of its README");
    out.col(j) = table.values.col(*column);
  }
  return out;
}

TorqueLog read_log(const std::filesystem::path& path, int joints, const std::string& torque) {
  const ChannelTable table = read_channel_table(path);
  TorqueLog log;
  log.sources = {path.string()};
  for (int j = 0; j < joints; ++j) log.joints.push_back({.name = fmt::format("joint{}", j + 1)});
  log.t_s = table.values.col(*table.column("t"));
  log.q = columns(table, "q", joints);
  log.dq = columns(table, "dq", joints);
  log.torque = columns(table, torque, joints);
  log.trajectory = Eigen::VectorXi::Zero(log.rows());
  log.trajectory_names = {path.stem().string()};
  log.source.assign(static_cast<std::size_t>(log.rows()), 0);
  log.lines = table.lines;
  return log;
}

}  // namespace kinescope
