// SPDX-License-Identifier: Apache-2.0
#include "app/commands/shard_parts.h"

#include <algorithm>
#include <system_error>

#include <fmt/format.h>

#include "app/commands/kept_observations.h"
#include "app/commands/shell_line.h"
#include "app/io/output_folder.h"
#include "app/io/sha256.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::string_view kSchema = "kinescope.part";
constexpr int kSchemaVersion = 1;

// That makes the shard of this run.
std::string command_for(const ShardPart& of, int index, const std::string& folder) {
  std::vector<std::string> words = of.arguments;
  words.insert(words.end(),
               {"--shard", to_string(Shard{index, of.shard.count}), "--output", folder});
  return shell_line(words);
}

std::string make_again(const ShardPart& part) {
  return "make it again: " + command_for(part, part.shard.index, part.folder.string());
}

json files_json(const std::vector<InputFile>& files) {
  json out = json::array();
  for (const InputFile& file : files) out.push_back({{"name", file.name}, {"sha256", file.sha256}});
  return out;
}

std::vector<InputFile> files_of(const json& document) {
  std::vector<InputFile> out;
  for (const json& file : document)
    out.push_back({file.at("name").get<std::string>(), file.at("sha256").get<std::string>()});
  return out;
}

// Throws json::exception where something is missing.
ShardPart part_of(const json& document) {
  ShardPart out;
  out.version = document.at("version").get<std::string>();
  const auto shard = parse_shard(document.at("shard").get<std::string>());
  out.shard = shard.value_or(Shard{});
  out.arguments = document.at("arguments").get<std::vector<std::string>>();
  out.working_folder = document.at("working_folder").get<std::string>();
  out.recordings = document.at("recordings").get<std::vector<std::string>>();
  for (const json& one : document.at("parts"))
    out.parts.push_back(
        {one.at("name").get<std::string>(), files_of(one.at("inputs")), files_of(one.at("files"))});
  return out;
}

void require_whole(const ShardPart& part) {
  for (const PartOfRecording& one : part.parts) {
    for (const InputFile& file : one.files) {
      const fs::path path = part.folder / file.name;
      std::error_code error;
      if (fs::exists(path, error) && sha256_of_file(path) == file.sha256) continue;
      throw bad_input(path.string(), "is missing, cut off or changed since the part was made",
                      make_again(part));
    }
  }
}

bool is_same_run(const ShardPart& one, const ShardPart& other) {
  return one.arguments == other.arguments && one.recordings == other.recordings &&
         one.shard.count == other.shard.count;
}

void require_each_once(const std::vector<ShardPart>& parts) {
  const ShardPart& first = parts.front();
  for (int index = 1; index <= first.shard.count; ++index) {
    const auto is_it = [&](const ShardPart& part) { return part.shard.index == index; };
    const auto found = std::ranges::find_if(parts, is_it);
    const std::string name = to_string(Shard{index, first.shard.count});
    if (found == parts.end()) {
      throw bad_request("merge", fmt::format("the part of shard {} is missing", name),
                        "make it: " + command_for(first, index, "FOLDER"));
    }
    const auto again = std::find_if(found + 1, parts.end(), is_it);
    if (again == parts.end()) continue;
    throw bad_request(again->folder.string(),
                      fmt::format("is shard {}, as {} is", name, found->folder.string()),
                      "give the part of each shard once");
  }
}

const PartOfRecording* part_named(const ShardPart& part, const std::string& name) {
  const auto found = std::ranges::find(part.parts, name, &PartOfRecording::name);
  return found == part.parts.end() ? nullptr : &*found;
}

// The first input that is in one list and not in the other.
std::optional<InputFile> differs(const std::vector<InputFile>& before,
                                 const std::vector<InputFile>& now) {
  for (const auto& [some, others] : {std::pair{&now, &before}, std::pair{&before, &now}})
    for (const InputFile& file : *some)
      if (std::ranges::none_of(*others, [&](const InputFile& other) {
            return other.name == file.name && other.sha256 == file.sha256;
          }))
        return file;
  return std::nullopt;
}

}  // namespace

json part_json(const ShardPart& part) {
  json parts = json::array();
  for (const PartOfRecording& one : part.parts) {
    parts.push_back(
        {{"name", one.name}, {"inputs", files_json(one.inputs)}, {"files", files_json(one.files)}});
  }
  return {{"schema", kSchema},
          {"schema_version", kSchemaVersion},
          {"program", "kinescope"},
          {"version", part.version},
          {"shard", to_string(part.shard)},
          {"arguments", part.arguments},
          {"working_folder", part.working_folder},
          {"recordings", part.recordings},
          {"parts", std::move(parts)}};
}

ShardPart read_part(const fs::path& folder) {
  const fs::path path = folder / kPartFile;
  std::error_code error;
  if (!fs::is_regular_file(path, error)) {
    throw bad_input(folder.string(), fmt::format("holds no {}: no part of a run", kPartFile),
                    "give folders that kinescope run --shard finished");
  }
  const json document = json::parse(read_text_file(path), nullptr, false);
  const bool known = document.is_object() && document.value("schema", json()) == kSchema;
  const std::string remedy = "run its shard again, with the same command";
  if (!known) throw bad_input(path.string(), "is cut off, damaged or no part of a run", remedy);
  if (document.value("schema_version", json()) != kSchemaVersion)
    throw bad_input(path.string(), "was written by another version of kinescope", remedy);
  try {
    ShardPart part = part_of(document);
    part.folder = folder;
    require_whole(part);
    return part;
  } catch (const json::exception&) {
    throw bad_input(path.string(), "is damaged: something is missing in it", remedy);
  }
}

void require_all_parts(const std::vector<ShardPart>& parts) {
  const ShardPart& first = parts.front();
  for (const ShardPart& part : parts) {
    if (part.version != program_version()) {
      throw bad_input(
          (part.folder / kPartFile).string(),
          fmt::format("was made by kinescope {}, and this is {}", part.version, program_version()),
          make_again(part));
    }
    if (is_same_run(part, first)) continue;
    throw bad_request(
        part.folder.string(),
        fmt::format("is of another run than {}: other recordings, options or number of shards",
                    first.folder.string()),
        "merge parts of one command, or make it again: " +
            command_for(first, std::min(part.shard.index, first.shard.count),
                        part.folder.string()));
  }
  require_each_once(parts);
}

void require_unchanged(const std::vector<ShardPart>& parts, const std::vector<Recording>& given) {
  if (parts.empty()) return;
  std::vector<std::string> now;
  for (const Recording& recording : given) now.push_back(recording.camera_name);
  if (now != parts.front().recordings) {
    throw bad_input(parts.front().folder.string(),
                    "the list names other recordings now than when the parts were made",
                    "make the parts again, or put the list back");
  }
  for (const ShardPart& part : parts) {
    for (const Recording& recording : given) {
      const PartOfRecording* const before = part_named(part, recording.camera_name);
      if (before == nullptr) continue;
      const auto other = differs(before->inputs, hash_inputs(recording));
      if (!other) continue;
      throw bad_input((recording.folder / other->name).string(),
                      fmt::format("is not as it was when {} was made", part.folder.string()),
                      make_again(part));
    }
  }
}

std::optional<TagObservations> observations_in(const std::vector<ShardPart>& parts,
                                               const Recording& recording,
                                               const DetectOptions& detect) {
  for (const ShardPart& part : parts) {
    if (part_named(part, recording.camera_name) == nullptr) continue;
    return read_kept_observations(part.folder, recording, detect);
  }
  return std::nullopt;
}

}  // namespace kinescope
