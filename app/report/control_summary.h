// SPDX-License-Identifier: Apache-2.0
//
// Takes   what `kinescope control` simulated: controllers on one trajectory.
// Gives   its findings in words, control.json (schema: app/io/schema/control.schema.json), the
// page. Units   rad or m, N m or N, s; one entry a joint.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"
#include "dynamics/control/servo.h"
#include "dynamics/identify/payload.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// One controller on the trajectory.
struct ControlRun {
  std::string name;  ///< in words
  ControlLaw law = ControlLaw::kPdGravity;
  std::string learned;            ///< kind of model; empty: nothing learned
  std::string payload = "none";   ///< what it carries: none, unknown, identified
  std::optional<int> round = {};  ///< of --rounds; 0: nothing learned yet
  std::string log = {};           ///< file
  Eigen::VectorXd error = {};     ///< rms, rad or m
  Eigen::VectorXd largest = {};   ///< rad or m
  Eigen::VectorXd feedback = {};  ///< rms of its torque over that of the command
  Eigen::VectorXd weight = {};    ///< mean of the learned part's
  Eigen::VectorXi limited = {};   ///< periods in which a limit held
  Eigen::MatrixXd errors = {};    ///< over time: rows of ControlSummary::t_s
};

struct ControlSummary {
  std::string robot, version, command;
  std::vector<InputFile> inputs;
  std::vector<std::string> joints;
  std::vector<JointType> types;
  ServoOptions servo;    ///< with its gains
  std::string model;     ///< of --model, in words; empty: none
  std::string training;  ///< what rounds learn on, in words; empty: no rounds
  std::uint64_t seed = 1;
  Eigen::Index samples = 0;  ///< of the trajectory
  Eigen::VectorXd t_s;       ///< of ControlRun::errors
  std::optional<double> payload_kg;
  std::optional<PayloadEstimate> payload;
  std::vector<ControlRun> runs;  ///< the first is PD with nominal gravity
};

[[nodiscard]] std::vector<std::string> control_findings(const ControlSummary& summary);
[[nodiscard]] nlohmann::json control_json(const ControlSummary& summary);
[[nodiscard]] std::string control_html(const ControlSummary& summary);
/// The joint of largest rms error.
[[nodiscard]] std::size_t worst_joint(const ControlRun& run);

}  // namespace kinescope
