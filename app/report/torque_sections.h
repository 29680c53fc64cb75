// SPDX-License-Identifier: Apache-2.0
//
// The sections of a torque report, each a function from the summary and its document to HTML.
#pragma once

#include <string>

#include "app/report/torque_summary.h"

namespace kinescope::report {

struct TorqueFacts {
  const TorqueSummary& summary;
  nlohmann::json result;  ///< torque_json(); tables take their numbers from here
};

[[nodiscard]] std::string torque_verdict_section(const TorqueFacts& facts);
[[nodiscard]] std::string torque_data_section(const TorqueFacts& facts);
/// nMSE and coverage of every model side by side, learning curves.
[[nodiscard]] std::string torque_models_section(const TorqueFacts& facts);
/// Measured and predicted torque over time with its band, one plot a joint.
[[nodiscard]] std::string torque_prediction_section(const TorqueFacts& facts);
/// The robust regressions, and the torque in friction, gravity and inertia parts.
[[nodiscard]] std::string torque_robust_section(const TorqueFacts& facts);
/// What the robot carries; empty where it was not asked for.
[[nodiscard]] std::string torque_payload_section(const TorqueFacts& facts);
/// Friction over velocity, drive and base parameters.
[[nodiscard]] std::string torque_parameters_section(const TorqueFacts& facts);
/// The traced model driven by measured torques alone; empty without a trace.
[[nodiscard]] std::string torque_rollout_section(const TorqueFacts& facts);
[[nodiscard]] std::string torque_reproduce_section(const TorqueFacts& facts);

}  // namespace kinescope::report
