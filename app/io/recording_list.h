// SPDX-License-Identifier: Apache-2.0
//
// Takes   recordings as they are named on a command line: folders, bags, datasets, and @FILE for
//         the lines of a text file.
// Gives   all of them, in order.
#pragma once

#include <filesystem>
#include <vector>

namespace kinescope {

/// A text file has one recording a line, as seen from the file's folder; empty lines and those that
/// begin with # are passed over. Relative words are seen from `from` (empty: the current folder).
/// Throws bad_input where a file cannot be read or lists nothing.
[[nodiscard]] std::vector<std::filesystem::path> listed_recordings(
    const std::vector<std::filesystem::path>& words, const std::filesystem::path& from = {});

}  // namespace kinescope
