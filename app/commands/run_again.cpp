// SPDX-License-Identifier: Apache-2.0
#include "app/commands/run_again.h"

#include "app/commands/command_line.h"
#include "app/commands/run_folder.h"

namespace kinescope {

RunOptions finished_options(const CommandLine& line) {
  RunOptions out = line.run;
  // Of several recordings their names say it, once they are read.
  if (out.output.empty() && out.further.empty())
    out.output = recording_name(out.recording.folder) + "_run";
  out.calibrate.estimate_time_offset = !line.no_time_offset;
  out.calibrate.estimate_intrinsics = out.estimate_intrinsics;
  return out;
}

RunOptions options_of_run(const std::filesystem::path& folder) {
  const RunAgain again = read_run_again(folder);
  CLI::App app;
  CommandLine first;
  add_commands(app, first);
  std::vector<std::string> reversed(again.arguments.rbegin(), again.arguments.rend());
  try {
    app.parse(reversed);
  } catch (const CLI::ParseError&) {
    throw bad_input((folder / "run.json").string(), "its command line is not understood",
                    "run the recording again");
  }
  if (!app.got_subcommand("run")) {
    throw bad_input((folder / "run.json").string(), "this is no folder of kinescope run",
                    "give the folder of a finished run");
  }
  RunOptions options = finished_options(first);
  resolve_paths(options.recording, again.working_folder);
  for (std::filesystem::path& recording : options.further)
    if (recording.is_relative()) recording = again.working_folder / recording;
  options.output = folder;
  options.arguments = again.arguments;
  return options;
}

}  // namespace kinescope
