// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace kinescope {

/// Parses the command line, runs one command, prints one line for an error. Returns the exit code
/// (README, "Exit codes").
[[nodiscard]] int run_program(int argc, const char* const* argv);

}  // namespace kinescope
