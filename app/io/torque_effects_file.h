// SPDX-License-Identifier: Apache-2.0
//
// Effects of torque that a file lists: a trace.json of `kinescope dynamics` (its key `effects`), or
// YAML written by hand:
//
//   effects:
//     - effect: stribeck        # a name of the library
//       joint: joint2           # or `place`, as in trace.json ("joint5 + joint6", "link7")
//       at: 0.05                # what trace.json calls `at`, for effects that have it
//       parameters: {excess_at_rest: 1.5}
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/effects/trace_torque.h"

namespace kinescope {

struct ListedEffect {
  TorqueEffect effect;   ///< parameters by name, in the file's order
  bool in_urdf = false;  ///< robot_traced.urdf has it already
  std::string place;     ///< in the file, for messages
};

struct ListedEffects {
  std::vector<ListedEffect> effects;
  bool traced = false;                        ///< a trace.json
  bool identified_masses = false;             ///< of a trace: on top of masses that it identified
  std::map<std::string, double> high_speeds;  ///< of a trace, by joint
  std::optional<LogSpan> log;                 ///< of a trace
};

/// Throws bad_input: missing file, neither of the above, numbers that are none.
[[nodiscard]] ListedEffects read_listed_effects(const std::filesystem::path& path);

/// The effects as the library has them: parameters in its order, those that are not named 0.
/// Throws bad_input, with the place in the file, for one that is not in `known`.
[[nodiscard]] std::vector<TorqueEffect> resolved(const std::vector<ListedEffect>& effects,
                                                 const std::vector<Candidate>& known);

}  // namespace kinescope
