// SPDX-License-Identifier: Apache-2.0
//
// Takes   logs of a robot in motion (CSV, also gzipped; one or several), what their columns mean,
// and
//         the joints of the tree.
// Gives   TorqueSamples and everything that is wrong with the logs.
// Units   rad, m, s, N m, N; columns in the order of the tree's movable joints.
// Method  column names (column_names.h), checks by physics (log_checks.h), one low-pass for motion
// and
//         torque with a cut-off chosen from their spectra (motion.h, cutoff.h).
// Not here: the rigid-body model (dynamics/rigid), scores and kernels (dynamics/gp).
#pragma once

#include <filesystem>
#include <vector>

#include "dynamics/data/log_checks.h"
#include "dynamics/data/log_findings.h"
#include "dynamics/data/motion.h"
#include "dynamics/data/torque_log.h"
#include "dynamics/data/torque_samples.h"
#include "kinematics/log/channel_table.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

struct TorqueDataOptions {
  LogMapping mapping;
  LogCheckOptions checks;
  MotionOptions motion;
};

struct TorqueData {
  TorqueSamples samples;
  std::vector<LogFinding> findings;  ///< refusals first, then warnings, then notes
  LowPass filter = LowPass::kSmoothingSpline;
  MotionSource source = MotionSource::kPosition;
  CutoffChoice cutoff;
  double rate_hz = 0.0;      ///< of the samples
  double log_rate_hz = 0.0;  ///< median, after stale rows were left out
  Eigen::Index rows_read = 0;
  Eigen::Index rows_used = 0;  ///< after the checks
};

/// The movable joints of a tree in its order, as the log is asked for them.
[[nodiscard]] std::vector<WantedJoint> wanted_joints(const KinematicTree& tree);

/// A log as the checks left it.
struct TorqueLogReport {
  TorqueLog log;  ///< after the repairs
  std::vector<LogFinding> findings;
  Eigen::Index rows_read = 0;
};

/// Reads, checks, filters. `joints` empty: all joints of the log, as named there. Throws Error for
/// what cannot be read and for findings that are refusals.
[[nodiscard]] TorqueData read_torque_data(const std::vector<std::filesystem::path>& files,
                                          const std::vector<WantedJoint>& joints,
                                          const TorqueDataOptions& options = {});

/// The two halves of it, for samples of one log at several cut-offs.
[[nodiscard]] TorqueLogReport read_checked_log(const std::vector<std::filesystem::path>& files,
                                               const std::vector<WantedJoint>& joints,
                                               const TorqueDataOptions& options = {});
[[nodiscard]] TorqueData filtered_data(const TorqueLogReport& report,
                                       const MotionOptions& options = {});

/// The same checks without throwing refusals: for looking at a log. Torques may be missing.
[[nodiscard]] TorqueLogReport look_at_torque_log(const std::vector<std::filesystem::path>& files,
                                                 const std::vector<WantedJoint>& joints,
                                                 const TorqueDataOptions& options = {});

/// All three from tables that somebody else has read (kinematics/bags); their warnings are
/// findings.
[[nodiscard]] TorqueData read_torque_data(const std::vector<ChannelTable>& tables,
                                          const std::vector<WantedJoint>& joints,
                                          const TorqueDataOptions& options = {});
[[nodiscard]] TorqueLogReport read_checked_log(const std::vector<ChannelTable>& tables,
                                               const std::vector<WantedJoint>& joints,
                                               const TorqueDataOptions& options = {});
[[nodiscard]] TorqueLogReport look_at_torque_log(const std::vector<ChannelTable>& tables,
                                                 const std::vector<WantedJoint>& joints,
                                                 const TorqueDataOptions& options = {});

}  // namespace kinescope
