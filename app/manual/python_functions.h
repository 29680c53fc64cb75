// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "app/manual/command_page.h"

namespace kinescope {

/// kinescope/commands.py: every command as a Python function, its options as keyword arguments with
/// their help as docstring (app/README.md, "Python"). The same options give the same bytes.
[[nodiscard]] std::string python_functions(const CommandPage& program);

}  // namespace kinescope
