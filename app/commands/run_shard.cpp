// SPDX-License-Identifier: Apache-2.0
#include "app/commands/run_shard.h"

#include <algorithm>
#include <cstdio>

#include <fmt/format.h>

#include "app/commands/kept_observations.h"
#include "app/commands/limits.h"
#include "app/commands/shard_parts.h"
#include "app/explain/join_recordings.h"
#include "app/explain/see_alone.h"
#include "app/io/json_text.h"
#include "app/io/output_folder.h"
#include "app/io/sha256.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

fs::path folder_of(const RunOptions& options, const Shard& shard) {
  if (!options.output.empty()) return options.output;
  return fmt::format("shard_{}_of_{}", shard.index, shard.count);
}

OutputFolder output_of(const RunOptions& options, const Shard& shard,
                       const std::vector<Recording>& recordings) {
  const fs::path folder = folder_of(options, shard);
  std::vector<std::string> products{std::string(kPartFile)};
  for (const Recording& recording : recordings) {
    require_apart(folder, recording.files);
    for (std::string& name : observations_files(recording.camera_name))
      products.push_back(std::move(name));
  }
  return {folder, {.command = "shard", .products = products, .inputs = {}, .force = options.force}};
}

// Only what takes long is kept: tables are read again as fast.
PartOfRecording seen_part(const Recording& recording, const RunOptions& options,
                          const OutputFolder& folder, const Console& console) {
  const Progress progress = [&](std::string_view stage, int done, int total) {
    report_progress(console.progress, fmt::format("{}: {}", recording.camera_name, stage), done,
                    total);
  };
  std::optional<TagObservations> kept;
  if (!options.force) kept = read_kept_observations(folder.file(""), recording, options.detect);
  const SeenAlone seen = see_alone(recording, options, kept, progress);
  for (const auto* warnings : {&recording.warnings, &seen.observed.warnings})
    for (const std::string& warning : *warnings)
      console.warn(fmt::format("{}: {}", recording.camera_name, warning));
  PartOfRecording out{recording.camera_name, hash_inputs(recording), {}};
  if (recording.entry != RecordingEntry::kVideo) return out;
  const auto files = kept_observations(recording, all_tags(seen.observed), options.detect);
  folder.write(files);
  for (const auto& [name, content] : files) out.files.push_back({name, sha256_of_text(content)});
  return out;
}

// Of an earlier part of other recordings.
void remove_stale(const ShardPart& part, const OutputFolder& folder) {
  for (const std::string& name : folder.own_products()) {
    const bool used = std::ranges::any_of(part.parts, [&](const PartOfRecording& one) {
      return std::ranges::find(one.files, name, &InputFile::name) != one.files.end();
    });
    if (!used) folder.remove(name);
  }
}

void print_part(const ShardPart& part, const Console& console) {
  if (console.json) {
    console.print(part_json(part));
    return;
  }
  fmt::print("Shard {}: {} of {} recordings.\npart    {}\n", to_string(part.shard),
             part.parts.size(), part.recordings.size(), (part.folder / kPartFile).string());
}

}  // namespace

ExitCode run_shard(const RunOptions& options, const Console& console) {
  if (options.further.empty())
    throw bad_request("--shard", "one recording is not shared out",
                      "name several recordings, or leave --shard out");
  static_cast<void>(parse_limits(options.fail_on));  // of the merged run: said before the long work
  const Shard shard = value_of(options.shard);
  const std::vector<Recording> recordings =
      read_recordings(options.recording, options.further, shard);
  const OutputFolder folder = output_of(options, shard, recordings);
  folder.remove(kPartFile);  // until all of it is there again
  ShardPart part{.folder = folder_of(options, shard),
                 .version = program_version(),
                 .shard = shard,
                 .arguments = options.arguments,
                 .working_folder = fs::current_path().string(),
                 .recordings = recording_names(options.recording, options.further),
                 .parts = {}};
  for (const Recording& recording : recordings)
    part.parts.push_back(seen_part(recording, options, folder, console));
  remove_stale(part, folder);
  folder.write(kPartFile, json_text(part_json(part)));
  print_part(part, console);
  return ExitCode::kDone;
}

}  // namespace kinescope
