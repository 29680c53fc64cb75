// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace kinescope {

/// A command line of the program as it is typed, the program's name before the words; what a shell
/// would take apart is in quotes.
[[nodiscard]] std::string shell_line(const std::vector<std::string>& words);

}  // namespace kinescope
