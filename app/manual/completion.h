// SPDX-License-Identifier: Apache-2.0
//
// Scripts that complete commands, options, the words that an option takes, files and folders.
#pragma once

#include <string>

#include "app/manual/command_page.h"

namespace kinescope {

/// For bash, also without the package bash-completion.
[[nodiscard]] std::string bash_completion(const CommandPage& program);

/// For zsh's completion system, a file of $fpath.
[[nodiscard]] std::string zsh_completion(const CommandPage& program);

}  // namespace kinescope
