// SPDX-License-Identifier: Apache-2.0
//
// Options of `kinescope export`. Shows CLI11, as command_line.h does.
#pragma once

#include "app/commands/command_line.h"

namespace kinescope {

void add_export(CLI::App& app, CommandLine& line);

}  // namespace kinescope
