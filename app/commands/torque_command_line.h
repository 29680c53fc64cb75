// SPDX-License-Identifier: Apache-2.0
//
// The commands that work on a torque log. Shows CLI11, as command_line.h does.
#pragma once

#include "app/commands/command_line.h"

namespace kinescope {

void add_dynamics(CLI::App& app, CommandLine& line);
/// What `inspect` takes for a torque log in place of a recording.
void add_inspect_log_options(CLI::App& inspect, CommandLine& line);
void add_predict(CLI::App& app, CommandLine& line);
void add_contact(CLI::App& app, CommandLine& line);

/// What the columns of a torque log are, where their names do not say it.
void add_log_options(CLI::App& command, CommandLine& line, TorqueDataOptions& data);
/// --cutoff.
void add_cutoff(CLI::App& command, TorqueDataOptions& data);

}  // namespace kinescope
