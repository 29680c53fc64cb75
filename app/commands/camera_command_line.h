// SPDX-License-Identifier: Apache-2.0
//
// The commands that make a recording: the camera's intrinsics, markers to print, a running camera.
// Shows CLI11, as command_line.h does.
#pragma once

#include "app/commands/command_line.h"

namespace kinescope {

void add_camera(CLI::App& app, CommandLine& line);
void add_markers(CLI::App& app, CommandLine& line);
void add_capture(CLI::App& app, CommandLine& line);

}  // namespace kinescope
