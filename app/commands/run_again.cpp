// SPDX-License-Identifier: Apache-2.0
#include "app/commands/run_again.h"

#include "app/commands/command_line.h"
#include "app/commands/run_folder.h"
#include "app/commands/shard_parts.h"
#include "app/io/recording_list.h"

namespace kinescope {

namespace fs = std::filesystem;

RunOptions finished_options(const CommandLine& line, const fs::path& from) {
  RunOptions out = line.run;
  std::vector<fs::path> words{out.recording.folder};
  words.insert(words.end(), out.further.begin(), out.further.end());
  const std::vector<fs::path> all = listed_recordings(words, from);
  out.recording.folder = all.front();
  out.further.assign(all.begin() + 1, all.end());
  // Of several recordings their names say it, once they are read.
  if (out.output.empty() && out.further.empty())
    out.output = recording_name(out.recording.folder) + "_run";
  out.calibrate.estimate_time_offset = !line.no_time_offset;
  out.calibrate.estimate_intrinsics = out.estimate_intrinsics;
  return out;
}

RunOptions options_of_words(const RunAgain& again, const fs::path& file) {
  CLI::App app;
  CommandLine first;
  add_commands(app, first);
  std::vector<std::string> reversed(again.arguments.rbegin(), again.arguments.rend());
  try {
    app.parse(reversed);
  } catch (const CLI::ParseError&) {
    throw bad_input(file.string(), "its command line is not understood", "run the recording again");
  }
  if (!app.got_subcommand("run")) {
    throw bad_input(file.string(), "this is no folder of kinescope run",
                    "give the folder of a finished run");
  }
  RunOptions options = finished_options(first, again.working_folder);
  resolve_paths(options.recording, again.working_folder);
  options.arguments = again.arguments;
  options.working_folder = again.working_folder;
  return options;
}

RunOptions options_of_run(const fs::path& folder) {
  RunOptions options = options_of_words(read_run_again(folder), folder / "run.json");
  options.output = folder;
  return options;
}

RunOptions options_of_merge(const MergeOptions& merge) {
  std::vector<ShardPart> parts;
  for (const fs::path& folder : merge.parts) parts.push_back(read_part(folder));
  require_all_parts(parts);
  const ShardPart& first = parts.front();
  // Parts that were made elsewhere are merged where the same words name the same recordings.
  std::error_code error;
  const fs::path from = fs::is_directory(first.working_folder, error)
                            ? fs::path(first.working_folder)
                            : fs::current_path();
  RunOptions options = options_of_words({first.arguments, from}, first.folder / kPartFile);
  options.output = merge.output;
  options.force = merge.force;
  options.command_line = merge.command_line;
  options.parts = std::move(parts);
  return options;
}

}  // namespace kinescope
