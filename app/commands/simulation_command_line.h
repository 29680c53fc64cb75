// SPDX-License-Identifier: Apache-2.0
//
// The commands that give a robot to a simulator, or simulate it. Shows CLI11, as command_line.h
// does.
#pragma once

#include "app/commands/command_line.h"

namespace kinescope {

void add_simulate(CLI::App& app, CommandLine& line);
void add_control(CLI::App& app, CommandLine& line);
void add_export(CLI::App& app, CommandLine& line);

}  // namespace kinescope
