// SPDX-License-Identifier: Apache-2.0
//
// Trials of learners as tables and drawings, for every experiment that compares them.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "app/report/experiment.h"
#include "dynamics/experiments/comparison_runs.h"

namespace kinescope {

/// What the settings of a comparison are.
struct SettingAxis {
  std::string label;           ///< with unit: "tilt (deg)"
  std::vector<double> values;  ///< one a setting, above zero
};

struct ComparisonFacts {
  const std::vector<experiments::Trial>& trials;
  SettingAxis axis;
  std::vector<experiments::Learner> learners;
  std::vector<std::string> joints;
  int runs = 0;
};

/// Errors of one learner and setting over runs; `joint` below 0: of all joints together.
[[nodiscard]] std::vector<double> errors_of(const ComparisonFacts& facts, int setting,
                                            experiments::Learner learner, int joint);
/// The median of those that are known; NaN of none.
[[nodiscard]] double median_error(const ComparisonFacts& facts, int setting,
                                  experiments::Learner learner, int joint);

/// "medians": a row a setting and learner, a column a joint; "spread": quartiles and the median
/// with its 95 % interval; "runs": every trial.
[[nodiscard]] std::vector<ExperimentTable> comparison_tables(const ComparisonFacts& facts);
/// The same of tests that were judged apart, by their names: one table of each kind, with a column
/// of words that names the test.
[[nodiscard]] std::vector<ExperimentTable> comparison_tables(
    const std::vector<std::pair<std::string, ComparisonFacts>>& tests);
/// Box plots of one setting, one a joint.
[[nodiscard]] std::vector<ExperimentSection::Figure> box_figures(const ComparisonFacts& facts,
                                                                 int setting);
/// Medians with their quartiles over the settings.
[[nodiscard]] ExperimentSection::Figure curve_figure(const ComparisonFacts& facts, int joint);

/// "joint2: gip 0.012 %, rbf 0.03 %": the best two of each joint by their medians, and what could
/// not be learned.
[[nodiscard]] std::vector<std::string> comparison_findings(const ComparisonFacts& facts,
                                                           int setting);

}  // namespace kinescope
