// SPDX-License-Identifier: Apache-2.0
//
// A hand-eye calibration and what it came from, gathered for its products.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/report.h"
#include "app/report/run_summary.h"
#include "calib/hand_eye/hand_eye.h"

namespace kinescope {

struct HandEyeSummary {
  RunSummary run;  ///< recording, inputs, options, times, warnings, markers; no robot
  HandEye hand_eye;
  std::string log;  ///< name of flange.csv, and of the column that it is matched by
  std::string time_column;
};

/// hand_eye.json (app/io/schema/hand_eye.schema.json). SI units; poses as in result.json;
/// covariances of right perturbations, rotation (rad) before translation (m).
[[nodiscard]] nlohmann::json hand_eye_json(const HandEyeSummary& summary);

/// What the page opens with and the program prints.
[[nodiscard]] Verdict hand_eye_verdict(const HandEyeSummary& summary);
/// One line for each row of the log that contradicts all others.
[[nodiscard]] std::vector<std::string> odd_row_lines(const HandEyeSummary& summary);

/// The page; `urdf` is shown in it.
[[nodiscard]] std::string hand_eye_report_html(const HandEyeSummary& summary,
                                               std::string_view urdf);

}  // namespace kinescope
