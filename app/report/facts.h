// SPDX-License-Identifier: Apache-2.0
//
// Everything a section of the report is written from.
#pragma once

#include <nlohmann/json.hpp>

#include "app/report/analysis.h"
#include "app/report/numbers.h"
#include "app/report/report.h"
#include "app/report/run_summary.h"

namespace kinescope::report {

struct Facts {
  const RunSummary& run;
  Analysis analysis;
  Verdict verdict;
  nlohmann::json result;  ///< the result document; tables take their numbers from here
};

[[nodiscard]] Facts gather_facts(const RunSummary& run);
[[nodiscard]] Verdict make_verdict(const RunSummary& run, const Analysis& analysis);
[[nodiscard]] nlohmann::json make_result(const RunSummary& run, const Analysis& analysis,
                                         const Verdict& verdict);

/// Coverage factor of every expanded uncertainty of the report.
inline constexpr double kCoverageFactor = 2.0;
/// Correlations of two parameters from here on are listed.
inline constexpr double kStrongCorrelation = 0.9;
/// A held-out error above this many times the training error is called a limit of the model.
inline constexpr double kRatioLimit = 1.1;
/// Noise found over noise declared from which the report speaks of it.
inline constexpr double kNoiseLimit = 1.5;
/// Share of the residual that follows one variable from which the report speaks of it.
inline constexpr double kDependenceLimit = 0.15;

/// "tag_7".
[[nodiscard]] std::string marker_name(TagId id);
/// Name of the link a marker sits on; "none" where the tree does not know it.
[[nodiscard]] std::string marker_link(const KinematicTree& tree, TagId id);
/// Name of a found link: that of the calibrated tree where it has one, "link<k>" else.
[[nodiscard]] std::string structure_link_name(const RunSummary& run, int link);
/// Correlation of two parameters; 0 where the covariance does not tell.
[[nodiscard]] double correlation(const Calibration& calibration, std::size_t a, std::size_t b);
/// Held-out over training error; 0 where there is no held-out error.
[[nodiscard]] double held_out_ratio(const Calibration& calibration);

/// What a value of such a joint is.
[[nodiscard]] Quantity joint_quantity(JointType type);

/// The words of a state, as the result document and the page show it.
[[nodiscard]] std::string status_words(StructureStatus status);
[[nodiscard]] std::string status_words(CalibrationStatus status);
[[nodiscard]] std::string_view to_string(MeasurementKind kind);

}  // namespace kinescope::report
