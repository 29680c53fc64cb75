// SPDX-License-Identifier: Apache-2.0
//
// The verdict's sentences, by what they are about.
#pragma once

#include <string>
#include <vector>

#include "app/report/analysis.h"
#include "app/report/run_summary.h"

namespace kinescope::report {

/// "a, b and c".
[[nodiscard]] std::string joined(const std::vector<std::string>& words);

/// "4 joints in a chain (R R P R)", "Nominal robot arm: 6 joints (R R R R R R)".
[[nodiscard]] std::string joints_words(const RunSummary& run);

/// " As declared it misses unseen postures by 4.4 mm, as calibrated by 0.24 mm." of a nominal robot
/// that is not taken as it is; else empty.
[[nodiscard]] std::string nominal_words(const RunSummary& run);

/// "the URDF has no element for backlash at j2: `kinescope correct` ..": what was found, and joint
/// readings have to be corrected by; empty: nothing.
[[nodiscard]] std::string beside_urdf_words(const RunSummary& run);

/// The structure: how many joints of which type, what drives them, how certain that is.
[[nodiscard]] std::string found_words(const RunSummary& run);

/// The joint whose axis's direction has the largest uncertainty: against the base, or among one
/// another where the base is far less certain than the axes. -1: none has one.
[[nodiscard]] int least_certain_axis(const Calibration& calibration);

/// The base is far less certain than what stands on it.
[[nodiscard]] bool is_base_apart(const TipUncertainty& tip);

/// "tag_44", what holds the base's frame: its first marker; "the base" where it has none.
[[nodiscard]] std::string base_words(const KinematicTree& tree);

/// "2.9 mm and 0.19°", expanded.
[[nodiscard]] std::string tip_figures_words(const TipFigures& figures);

/// Something that the model lacks shows, beside what its uncertainties hold.
[[nodiscard]] bool is_model_short(const RunSummary& run);

/// Where the last link is, errors on data that the fit has not seen, uncertainties of the axes,
/// what all figures take for granted, the clock.
[[nodiscard]] std::string accuracy_words(const RunSummary& run,
                                         const std::optional<TipUncertainty>& tip);

}  // namespace kinescope::report
