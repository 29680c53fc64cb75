// SPDX-License-Identifier: Apache-2.0
//
// Takes   a ChannelTable and a LogMapping: which column is which joint's what, and in which unit.
// Gives   TorqueLog: the signals of the wanted joints, in SI, faults of the log still in it.
// Units   rad, m, s and N m inside; the mapping, or a unit in the column's name, says what is
// converted. Method  names as in column_names.h; joints by name, else by number, else by order. Not
// here: what is wrong with the signals (log_checks.h), filtering (motion.h).
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "dynamics/data/log_findings.h"
#include "dynamics/data/torque_samples.h"
#include "kinematics/log/channel_table.h"

namespace kinescope {

/// A joint that is wanted from the log.
struct WantedJoint {
  std::string name;
  bool prismatic = false;
};

/// What a log's columns are. All empty: found by their names. Fills from the key `dynamics` of
/// recording.yaml. A list of columns has one entry a joint in the wanted order, or one with `*` in
/// it, which stands for all columns it fits, in the file's order. A list of units or factors has
/// one entry for all joints or one a joint.
struct LogMapping {
  std::string time;                       ///< column of the stamps
  std::string time_unit;                  ///< s, ms, us, ns
  double rate_hz = 0.0;                   ///< of a log without stamps; wins over a column of stamps
  std::string trajectory;                 ///< column that numbers or names the trajectories
  std::vector<std::string> position;      ///< columns
  std::vector<std::string> velocity;      ///< columns
  std::vector<std::string> acceleration;  ///< columns
  std::vector<std::string> torque;        ///< columns, also of currents
  std::vector<std::string> position_unit;      ///< rad, deg, m, mm
  std::vector<std::string> velocity_unit;      ///< rad/s, deg/s, m/s, mm/s
  std::vector<std::string> acceleration_unit;  ///< rad/s^2, deg/s^2, m/s^2, mm/s^2
  std::vector<std::string> torque_unit;        ///< Nm, N, mNm, kNm, A, mA
  std::vector<double> position_factor;  ///< sign or gear: joint value per logged value (q, dq, ddq)
  std::vector<double> torque_factor;    ///< sign, gear or drive gain: joint torque per logged value
  std::map<std::string, std::string> joints;  ///< joint's name: what the log's columns call it
};

/// The signals as logged, in SI. Matrices are rows x joints; those that are not logged have no
/// columns.
struct TorqueLog {
  std::vector<std::string> sources;    ///< files
  std::vector<WantedJoint> joints;     ///< one a column
  Eigen::VectorXd t_s;                 ///< as stamped, or row / rate
  Eigen::MatrixXd q, dq, ddq, torque;  ///< NaN where the file has no number
  MissingTorque torque_missing;        ///< rows x joints; empty: none is
  Eigen::VectorXi trajectory;          ///< 0, 1, .. in the file's order
  std::vector<std::string> trajectory_names;
  std::vector<int> source;         ///< of each row, index of sources
  std::vector<std::size_t> lines;  ///< of each row, in its file
  std::vector<std::string> q_columns, dq_columns, ddq_columns,
      torque_columns;               ///< names in the file
  Eigen::MatrixXd q_command;        ///< commanded positions where the log has them
  std::string torque_unit = "Nm";   ///< "Nm", or "A" where currents have no torque_factor
  bool time_unit_declared = false;  ///< by the mapping or the column's name
  bool stamped = true;              ///< false: no column of stamps
  bool position_unit_declared = false;
  bool velocity_unit_declared = false;

  [[nodiscard]] Eigen::Index rows() const { return t_s.size(); }
  [[nodiscard]] Eigen::Index columns() const { return q.cols(); }
  [[nodiscard]] bool is_missing(Eigen::Index row, Eigen::Index joint) const {
    return torque_missing.size() > 0 && torque_missing(row, joint);
  }
  /// "file:line" of a row.
  [[nodiscard]] std::string place(Eigen::Index row) const;
  /// The first row of every trajectory and the end.
  [[nodiscard]] std::vector<Eigen::Index> bounds() const;
};

struct ReadTorqueLog {
  TorqueLog log;
  std::vector<LogFinding> findings;  ///< how columns were taken
};

/// `wanted` empty: all joints of the log, named as there. Throws bad_input: no position columns, no
/// torque columns (with `torque_required`), joints that cannot be matched (naming both lists and
/// the option); bad_request: a column of the mapping that the file does not have, an unknown unit,
/// a list of the wrong length.
[[nodiscard]] ReadTorqueLog to_torque_log(const ChannelTable& table, const LogMapping& mapping,
                                          const std::vector<WantedJoint>& wanted,
                                          bool torque_required = true);

/// The rows for which `keep` is not 0; trajectory numbers stay.
[[nodiscard]] TorqueLog keep_rows(const TorqueLog& log, const std::vector<char>& keep);

/// A joint's torques without those that are missing.
[[nodiscard]] std::vector<double> measured_torques(const TorqueLog& log, Eigen::Index joint);

/// One log after another; trajectory numbers go on, and names get that of their file. All must have
/// the same joints and signals.
[[nodiscard]] TorqueLog join(const std::vector<TorqueLog>& logs);

}  // namespace kinescope
