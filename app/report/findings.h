// SPDX-License-Identifier: Apache-2.0
//
// What limits a result, and what to record instead; the weightiest first.
#pragma once

#include <string>
#include <vector>

#include "app/report/analysis.h"
#include "app/report/run_summary.h"

namespace kinescope::report {

struct Finding {
  double weight = 0.0;         ///< orders the findings; no other meaning
  std::string what;            ///< one sentence with its number
  std::string remedy;          ///< one sentence; may be empty
  bool asks_postures = false;  ///< the remedy is other postures, which `plan` can choose
};

/// At least one: where nothing limits the model, the noise of the measurement does.
[[nodiscard]] std::vector<Finding> find_limits(const RunSummary& run, const Analysis& analysis);

/// A sentence of other rooms, begun with a capital, but for a name ("tag_12", "q2"), and closed
/// with a full stop.
[[nodiscard]] std::string sentence(std::string text);

/// "j6 of the nominal robot turns about x of its frame, not z: .." in one sentence with errors; one
/// for all columns in the same unit.
[[nodiscard]] std::vector<std::string> fault_sentences(const KinematicTree& nominal,
                                                       const std::vector<NominalFault>& faults);

}  // namespace kinescope::report
