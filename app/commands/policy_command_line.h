// SPDX-License-Identifier: Apache-2.0
//
// `kinescope policy` on the command line. Shows CLI11, as command_line.h does.
#pragma once

#include "app/commands/command_line.h"

namespace kinescope {

void add_policy(CLI::App& app, CommandLine& line);

}  // namespace kinescope
