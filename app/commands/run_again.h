// SPDX-License-Identifier: Apache-2.0
//
// The options that a finished run was started with, from its run.json.
#pragma once

#include <filesystem>

#include "app/commands/commands.h"
#include "app/commands/run_folder.h"

namespace kinescope {

struct CommandLine;

/// Options of `run` with what follows from others filled in, lists of recordings too; their words
/// are seen from the folder (empty: the current one).
[[nodiscard]] RunOptions finished_options(const CommandLine& line,
                                          const std::filesystem::path& from = {});

/// Of words that run.json or part.json keeps, paths as seen from here. Throws bad_input, naming the
/// file that they are from, where they are no command line of `run`.
[[nodiscard]] RunOptions options_of_words(const RunAgain& again, const std::filesystem::path& file);

/// Of the run in the folder, its paths as seen from here, the folder its output. Throws bad_input
/// where run.json does not say, or was written by something else.
[[nodiscard]] RunOptions options_of_run(const std::filesystem::path& folder);

/// Of the run whose parts these are, all of them, with what they hold. Throws bad_input where one
/// cannot be read, is damaged or of another version; bad_request where they are not the parts of
/// one run, each once, and says how a missing one is made.
[[nodiscard]] RunOptions options_of_merge(const MergeOptions& merge);

}  // namespace kinescope
