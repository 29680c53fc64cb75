// SPDX-License-Identifier: Apache-2.0
//
// Values of the result document: what is not finite becomes null, text becomes valid UTF-8.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"

namespace kinescope::report {

[[nodiscard]] nlohmann::json number(double value);
[[nodiscard]] nlohmann::json numbers(const Eigen::VectorXd& values);
[[nodiscard]] nlohmann::json standard(const Sigma& sigma);
/// Twice the standard uncertainty; null where there is none.
[[nodiscard]] nlohmann::json expanded(const Sigma& sigma);
[[nodiscard]] nlohmann::json text(std::string_view value);
[[nodiscard]] nlohmann::json texts(const std::vector<std::string>& values);
/// [name, sha256] of each.
[[nodiscard]] nlohmann::json inputs_json(const std::vector<InputFile>& inputs);
[[nodiscard]] nlohmann::json vector3(const Eigen::Vector3d& v);
/// Translation, quaternion and URDF's fixed-axis roll, pitch, yaw.
[[nodiscard]] nlohmann::json pose(const Pose& T);

/// The keys `calibration` and `observability` of the document.
[[nodiscard]] nlohmann::json calibration_json(const RunSummary& run);
[[nodiscard]] nlohmann::json observability_json(const Calibration& calibration);

}  // namespace kinescope::report
