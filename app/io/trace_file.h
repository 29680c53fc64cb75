// SPDX-License-Identifier: Apache-2.0
//
// trace.json of a run, as far as another run is compared with it.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/trace/traced_model.h"

namespace kinescope {

/// An effect that was found, with its size.
struct StoredEffect {
  std::string effect, place, unit;
  double size = 0.0;
  double sigma = 0.0;  ///< a quarter of the width of its 95 % interval
};

/// One that was looked for and not found.
struct StoredAbsence {
  std::string effect, place, unit;
  std::optional<double> smallest_size;  ///< that would have been found in 95 of 100 recordings;
                                        ///< none: the recording cannot show it
};

struct StoredTrace {
  std::vector<StoredEffect> found;
  std::vector<StoredAbsence> absent;
  bool unexplained = false;  ///< something is left that no known effect has the shape of
  /// Effects each of which explains what the others do; the one that is in the model first.
  std::vector<std::vector<EffectId>> ambiguous = {};
  std::map<EffectId, double> scans = {};  ///< of what was tested: the value that fits best
  int stretches = 0;                      ///< independent stretches of the recording; 0: not known
};

/// Nothing where there is no such file (a run with --no-trace). Throws bad_input where it is none
/// of a run.
[[nodiscard]] std::optional<StoredTrace> read_trace(const std::filesystem::path& trace_json);

}  // namespace kinescope
