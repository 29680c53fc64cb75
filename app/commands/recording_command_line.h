// SPDX-License-Identifier: Apache-2.0
//
// The commands that work on recordings. Shows CLI11, as command_line.h does.
#pragma once

#include "app/commands/command_line.h"

namespace kinescope {

void add_run(CLI::App& app, CommandLine& line);
void add_merge(CLI::App& app, CommandLine& line);
void add_fleet(CLI::App& app, CommandLine& line);
void add_inspect(CLI::App& app, CommandLine& line);

}  // namespace kinescope
