// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>

#include "dynamics/data/torque_log.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

std::vector<Eigen::Index> kept_rows(const std::vector<char>& keep) {
  std::vector<Eigen::Index> rows;
  for (std::size_t row = 0; row < keep.size(); ++row) {
    if (keep[row] != 0) rows.push_back(static_cast<Eigen::Index>(row));
  }
  return rows;
}

Eigen::MatrixXd rows_of(const Eigen::MatrixXd& matrix, const std::vector<Eigen::Index>& rows) {
  if (matrix.cols() == 0) return {};
  return matrix(rows, Eigen::all);
}

Eigen::MatrixXd stacked(const Eigen::MatrixXd& top, const Eigen::MatrixXd& bottom) {
  Eigen::MatrixXd out(top.rows() + bottom.rows(), top.cols());
  out << top, bottom;
  return out;
}

/// Of all rows of a log: false where nothing is missing.
MissingTorque all_missing(const TorqueLog& log) {
  if (log.torque_missing.size() > 0) return log.torque_missing;
  return MissingTorque::Constant(log.rows(), log.torque.cols(), false);
}

void append(TorqueLog& log, const TorqueLog& next) {
  const bool alike = log.q.cols() == next.q.cols() && log.dq.cols() == next.dq.cols() &&
                     log.ddq.cols() == next.ddq.cols() && log.torque.cols() == next.torque.cols() &&
                     log.torque_unit == next.torque_unit && log.stamped == next.stamped;
  if (!alike) {
    throw bad_input(next.sources.front(),
                    fmt::format("does not hold the same signals as {}", log.sources.front()),
                    "name files of one kind together");
  }
  const int shift = static_cast<int>(log.trajectory_names.size());
  const int sources = static_cast<int>(log.sources.size());
  Eigen::VectorXd t_s(log.rows() + next.rows());
  t_s << log.t_s, next.t_s;
  Eigen::VectorXi trajectory(log.rows() + next.rows());
  trajectory << log.trajectory, next.trajectory.array() + shift;
  log.t_s = t_s;
  log.trajectory = trajectory;
  log.q = stacked(log.q, next.q);
  log.dq = log.dq.cols() > 0 ? stacked(log.dq, next.dq) : log.dq;
  log.ddq = log.ddq.cols() > 0 ? stacked(log.ddq, next.ddq) : log.ddq;
  if (log.torque_missing.size() + next.torque_missing.size() > 0) {
    MissingTorque missing(t_s.size(), next.torque.cols());
    missing << all_missing(log), all_missing(next);
    log.torque_missing = std::move(missing);
  }
  log.torque = log.torque.cols() > 0 ? stacked(log.torque, next.torque) : log.torque;
  const bool commands = log.q_command.cols() > 0 && next.q_command.cols() == log.q_command.cols();
  log.q_command = commands ? stacked(log.q_command, next.q_command) : Eigen::MatrixXd();
  log.lines.insert(log.lines.end(), next.lines.begin(), next.lines.end());
  for (const int source : next.source) log.source.push_back(source + sources);
  log.sources.insert(log.sources.end(), next.sources.begin(), next.sources.end());
  log.trajectory_names.insert(log.trajectory_names.end(), next.trajectory_names.begin(),
                              next.trajectory_names.end());
}

/// The file's name, with its folder's where another file has the same name.
std::string short_name(const TorqueLog& log, const std::vector<TorqueLog>& all) {
  const std::filesystem::path file(log.sources.front());
  const auto alike = std::ranges::count_if(all, [&](const TorqueLog& other) {
    return std::filesystem::path(other.sources.front()).filename() == file.filename();
  });
  if (alike < 2 || file.parent_path().filename().empty()) return file.filename().string();
  return (file.parent_path().filename() / file.filename()).string();
}

/// Trajectories are named with their file: each file may have a first one.
void name_after_file(const std::string& name, TorqueLog& log) {
  const std::string file = std::filesystem::path(log.sources.front()).filename().string();
  for (std::string& trajectory : log.trajectory_names) {
    trajectory = trajectory == file ? name : fmt::format("{}: {}", name, trajectory);
  }
}

}  // namespace

std::string TorqueLog::place(Eigen::Index row) const {
  const auto at = static_cast<std::size_t>(row);
  return fmt::format("{}:{}", sources[static_cast<std::size_t>(source[at])], lines[at]);
}

std::vector<Eigen::Index> TorqueLog::bounds() const {
  std::vector<Eigen::Index> out;
  for (Eigen::Index row = 0; row < rows(); ++row) {
    if (row == 0 || trajectory(row) != trajectory(row - 1)) out.push_back(row);
  }
  out.push_back(rows());
  return out;
}

TorqueLog keep_rows(const TorqueLog& log, const std::vector<char>& keep) {
  KINESCOPE_CHECK(keep.size() == static_cast<std::size_t>(log.rows()), "one flag a row");
  const std::vector<Eigen::Index> rows = kept_rows(keep);
  TorqueLog out = log;
  out.t_s = log.t_s(rows);
  out.q = rows_of(log.q, rows);
  out.dq = rows_of(log.dq, rows);
  out.ddq = rows_of(log.ddq, rows);
  out.torque = rows_of(log.torque, rows);
  out.q_command = rows_of(log.q_command, rows);
  if (log.torque_missing.size() > 0) out.torque_missing = log.torque_missing(rows, Eigen::all);
  out.trajectory = log.trajectory(rows);
  out.source.clear();
  out.lines.clear();
  for (const Eigen::Index row : rows) {
    out.source.push_back(log.source[static_cast<std::size_t>(row)]);
    out.lines.push_back(log.lines[static_cast<std::size_t>(row)]);
  }
  return out;
}

std::vector<double> measured_torques(const TorqueLog& log, Eigen::Index joint) {
  std::vector<double> out;
  for (Eigen::Index row = 0; row < log.rows(); ++row)
    if (!log.is_missing(row, joint)) out.push_back(log.torque(row, joint));
  return out;
}

TorqueLog join(const std::vector<TorqueLog>& logs) {
  KINESCOPE_CHECK(!logs.empty(), "nothing to join");
  TorqueLog out = logs.front();
  if (logs.size() == 1) return out;
  name_after_file(short_name(logs.front(), logs), out);
  for (std::size_t k = 1; k < logs.size(); ++k) {
    TorqueLog next = logs[k];
    name_after_file(short_name(logs[k], logs), next);
    append(out, next);
  }
  return out;
}

}  // namespace kinescope
