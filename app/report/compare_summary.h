// SPDX-License-Identifier: Apache-2.0
//
// Takes   what `kinescope compare` found between several calibrations of one robot.
// Gives   its verdict and findings in words, compare.json (schema:
// app/io/schema/compare.schema.json),
//         the page.
// Units   SI; of ratios relative changes.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"
#include "calib/quality/robot_difference.h"

namespace kinescope {

/// One calibration as it stands.
struct ComparedRun {
  std::string name;       ///< its folder, as it was named
  std::string robot;      ///< the tree's name
  std::string recording;  ///< that it is of; empty: not known
  double held_out_rms = 0.0;
  std::string rms_unit;
  double time_offset_s = 0.0;  ///< of the recording, not of the robot
  Sigma time_offset_sigma_s;
};

/// A run against the first.
struct RunDifference {
  std::vector<std::string> structure;          ///< what differs of it, in words; empty: the same
  bool by_order = false;                       ///< joints were matched by order, not by channel
  std::vector<QuantityDifference> quantities;  ///< worst first; empty where the structure differs
  std::vector<std::string> notes;              ///< what limits the comparison
};

/// The model of one run on the recording of another, held out.
struct CarriedOver {
  std::size_t model = 0;      ///< index of runs
  std::size_t recording = 0;  ///< likewise
  std::string skipped;        ///< why it was not done; empty: it was
  double own_rms = 0.0;       ///< of the recording's own model, on the same sightings
  double carried_rms = 0.0;
  std::string unit;
  double p_value = 1.0;  ///< one-sided, of being no worse than its own model
  bool carries = false;
};

struct CompareSummary {
  std::string version, command;
  std::vector<InputFile> inputs;
  double level = 0.05;  ///< of calling anything changed where nothing is
  std::vector<ComparedRun> runs;
  std::vector<RunDifference> differences;  ///< of runs 2, 3, .. against the first
  std::vector<CarriedOver> carried;
};

/// A structure or a number differs.
[[nodiscard]] bool anything_changed(const CompareSummary& summary);
/// A model was tried on another's recording and predicts it worse.
[[nodiscard]] bool anything_fails_to_carry(const CompareSummary& summary);

/// One line: the same robot within noise, or what changed.
[[nodiscard]] std::string compare_verdict(const CompareSummary& summary);
/// Lines that follow: structure first, then numbers, then what limits them, then predictions.
[[nodiscard]] std::vector<std::string> compare_findings(const CompareSummary& summary);
[[nodiscard]] nlohmann::json compare_json(const CompareSummary& summary);
[[nodiscard]] std::string compare_html(const CompareSummary& summary);

}  // namespace kinescope
