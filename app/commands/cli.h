// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "kinematics/core/error.h"
#include "kinematics/core/progress.h"

namespace kinescope {

/// Of a process of its own, first of all: may start it anew (kinematics/core/blas_kernels.h); a
/// file over the limit (ulimit -f) is then one that cannot be written, and said to be.
void prepare_process(char** argv);

/// Parses the command line, runs one command, prints one line for an error. Returns the exit code
/// (README, "Exit codes").
[[nodiscard]] int run_program(int argc, const char* const* argv);

/// What a command came to that another program called.
struct CalledCommand {
  ExitCode code = ExitCode::kDone;
  std::string message = {};  ///< one line: why it is not kDone; empty where the result says it
  std::string result = {};   ///< what --json prints; empty: it did not come that far
  std::vector<std::string> warnings = {};
};

/// The same as a function that prints nothing. `arguments`: the command's name and what follows it
/// on a command line. Any thread; several may call at once.
[[nodiscard]] CalledCommand call_command(const std::vector<std::string>& arguments,
                                         const Progress& progress = {});

}  // namespace kinescope
