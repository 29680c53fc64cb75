// SPDX-License-Identifier: Apache-2.0
//
// The commands that simulate a robot. Shows CLI11, as command_line.h
// does.
#pragma once

#include "app/commands/command_line.h"

namespace kinescope {

void add_simulate(CLI::App& app, CommandLine& line);
void add_control(CLI::App& app, CommandLine& line);

}  // namespace kinescope
