// SPDX-License-Identifier: Apache-2.0
//
// `kinescope policy` as a function.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "app/commands/commands.h"
#include "dynamics/policy/sensing.h"
#include "dynamics/policy/velocity_model.h"

namespace kinescope {

struct PolicyCommandOptions {
  std::string system;  ///< a problem of the literature, or a YAML file
  std::uint64_t seed = 1;
  /// First and last of several, each in a folder of its own in `output`; none: `seed` alone.
  std::optional<std::pair<int, int>> seeds;
  std::optional<int> trials;  ///< with a learned policy; none: the system's own number
  int explorations = 1;       ///< trials with random inputs, first
  int particles = 400;
  int basis_functions = 200;
  int starts = 3;           ///< of each search; the best goes on
  int search_steps = 4000;  ///< of each search, at most
  policy::VelocityKernel kernel = policy::VelocityKernel::kSquaredExponential;
  std::optional<policy::Sensing> sensing;  ///< of a problem of the literature; none: full state
  bool plain = false;                      ///< positions alone, but the model knows nothing of it
  int threads = 0;                         ///< 0: all of the machine
  std::filesystem::path output;            ///< folder
  bool force = false;                      ///< begin anew, and replace what others wrote
  std::string command_line;                ///< for the page
};

[[nodiscard]] ExitCode policy_command(const PolicyCommandOptions& options, const Console& console);

}  // namespace kinescope
