// SPDX-License-Identifier: Apache-2.0
//
// The commands that go on from the folder of a finished run. Shows CLI11, as command_line.h does.
#pragma once

#include "app/commands/command_line.h"

namespace kinescope {

void add_trace(CLI::App& app, CommandLine& line);
void add_correct(CLI::App& app, CommandLine& line);
void add_compare(CLI::App& app, CommandLine& line);
void add_plan(CLI::App& app, CommandLine& line);

}  // namespace kinescope
