// SPDX-License-Identifier: Apache-2.0
#include "app/commands/command_line.h"

#include <fmt/format.h>

#include "app/commands/camera_command_line.h"
#include "app/commands/command_options.h"
#include "app/commands/experiment_command_line.h"
#include "app/commands/export_command_line.h"
#include "app/commands/policy_command_line.h"
#include "app/commands/recording_command_line.h"
#include "app/commands/run_folder_command_line.h"
#include "app/commands/simulation_command_line.h"
#include "app/commands/torque_command_line.h"

namespace kinescope {

void add_commands(CLI::App& app, CommandLine& line) {
  app.name("kinescope");
  app.description("Learns a robot's body from a video of markers and a joint log");
  app.set_version_flag("--version", fmt::format("kinescope {}", KINESCOPE_VERSION));
  app.set_help_flag("--help,-h", "Print this help");
  app.require_subcommand(1);
  app.footer(
      fmt::format("Example:\n  kinescope inspect sample_videos/scara4_none\n  kinescope run "
                  "sample_videos/scara4_none\n\n{}",
                  kExitCodes));
  add_run(app, line);
  add_merge(app, line);
  add_fleet(app, line);
  add_trace(app, line);
  add_correct(app, line);
  add_compare(app, line);
  add_plan(app, line);
  add_dynamics(app, line);
  add_predict(app, line);
  add_simulate(app, line);
  add_control(app, line);
  add_export(app, line);
  add_contact(app, line);
  add_experiment(app, line);
  add_policy(app, line);
  add_inspect(app, line);
  add_camera(app, line);
  add_markers(app, line);
  add_capture(app, line);
}

}  // namespace kinescope
