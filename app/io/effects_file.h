// SPDX-License-Identifier: Apache-2.0
//
// The effects of a calibration in calibration.json (key `effects`): written, and read back to undo
// them on other logs.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "calib/effects/trace_calibration.h"

namespace kinescope {

/// A list: effect, place, at (the value of its scan), parameters (name, unit, value, reference), of
/// a curve its table, and the range of a joint over which the effect was observed.
[[nodiscard]] nlohmann::json effects_json(const std::vector<FittedEffect>& effects);

/// How channels become a joint's value (`Joint`), readings in SI where their unit was declared.
struct JointChannel {
  std::string joint;
  std::string channel;
  double scale = 1.0;
  double offset = 0.0;
  std::vector<ChannelShare> couplings;
  std::vector<std::string> copies;   ///< `Joint`
  std::optional<JointLimits> range;  ///< of the joint's value in the recording
};

/// What undoing needs of calibration.json.
struct CalibratedEffects {
  std::vector<JointChannel> channels;
  std::vector<FittedEffect> effects;
  std::optional<Eigen::Vector3d> gravity_base;  ///< key `gravity_base`
  /// Channel: what its logged values are to be multiplied by first; absent: 1. Key `unit_factors`.
  std::map<std::string, double> unit_factors;
};

/// Throws bad_input: missing file, no JSON, another schema, numbers that are none.
[[nodiscard]] CalibratedEffects read_effects(const std::filesystem::path& calibration_json);

}  // namespace kinescope
