// SPDX-License-Identifier: Apache-2.0
//
// The options that a finished run was started with, from its run.json.
#pragma once

#include <filesystem>

#include "app/commands/commands.h"

namespace kinescope {

struct CommandLine;

/// Options of `run` with what follows from others filled in.
[[nodiscard]] RunOptions finished_options(const CommandLine& line);

/// Of the run in the folder, its paths as seen from here, the folder its output. Throws bad_input
/// where run.json does not say, or was written by something else.
[[nodiscard]] RunOptions options_of_run(const std::filesystem::path& folder);

}  // namespace kinescope
