// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/contact/contact.h"
#include "dynamics/data/torque_data.h"
#include "dynamics/models/torque_model.h"

namespace kinescope {

struct DynamicsOptions {
  std::vector<std::filesystem::path> logs;
  std::vector<std::filesystem::path> test_logs;  ///< judged on; empty: the logs' last part
  std::filesystem::path robot;                   ///< URDF
  std::filesystem::path output;                  ///< folder
  TorqueDataOptions data;
  TorqueModelOptions models_options;
  std::vector<std::string> models;              ///< names, "all"; empty: the usual ones, quickly
  std::optional<Eigen::Vector3d> gravity_m_s2;  ///< in the base frame; default: 9.81 down z
  /// Where nobody declared it and the torques contradict the default, what they say is taken.
  bool gravity_from_torques = false;
  /// Held out are single samples by lot, as in much of the literature; else whole trajectories or a
  /// block, as what a model is worth on new motion asks for.
  bool split_at_random = false;
  bool learning_curve = false;
  /// The robust regressions beside the models, and of a payload at rest; nothing: where all models
  /// are asked for, and of a payload.
  std::optional<bool> robust;
  /// What the robot carries: against the URDF's masses, or against logs without the load.
  bool payload = false;
  std::vector<std::filesystem::path> unloaded_logs;  ///< ask for the payload too
  std::string payload_link;                          ///< empty: the last one
  bool trace = true;                      ///< close the loop: look for effects beyond rigid bodies
  std::string trace_file = "trace.json";  ///< in the output folder
  /// Where the best model goes (the one named, where it is one); empty: nowhere.
  std::filesystem::path save_model;
  std::string owner = "dynamics";  ///< the command whose products these are (OutputFolder)
  bool force = false;              ///< replace what others wrote
  std::string command_line;        ///< for the report
};

struct ContactCommandOptions {
  std::vector<std::filesystem::path> logs;
  std::vector<std::filesystem::path> learn_logs;  ///< noise and masses; empty: the logs themselves
  std::filesystem::path robot;                    ///< URDF
  std::filesystem::path output;                   ///< folder
  TorqueDataOptions data;
  ContactOptions contact;
  bool identify = false;  ///< masses and friction from the log although the URDF has some
  /// Whose residual is looked at in place of the momentum balance: a file of dynamics --save-model,
  /// or the name of a model to learn. Empty: none.
  std::string model;
  std::optional<Eigen::Vector3d> gravity_m_s2;  ///< in the base frame; default: 9.81 down z
  std::string owner = "contact";                ///< as DynamicsOptions
  bool force = false;                           ///< as DynamicsOptions
  std::string command_line;                     ///< for the report
};

}  // namespace kinescope
