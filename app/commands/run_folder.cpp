// SPDX-License-Identifier: Apache-2.0
#include "app/commands/run_folder.h"

#include <algorithm>
#include <array>
#include <system_error>

#include <fmt/format.h>

#include "app/commands/kept_observations.h"
#include "app/io/json_text.h"
#include "app/io/same_place.h"
#include "kinematics/core/file.h"
#include "kinematics/core/text.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::vector<std::string> products_of(const Recording& recording) {
  std::vector<std::string> out = run_products(!recording.log.torque_columns.empty());
  std::vector<std::string> names = recording.joined;
  for (const RecordedCamera& camera : recording.cameras) names.push_back(camera.name);
  for (const std::string& name : names) {
    for (std::string& file : observations_files(name)) out.push_back(std::move(file));
  }
  return out;
}

// run.json; nothing where there is none of a run.
std::optional<json> run_document(const fs::path& folder) {
  const fs::path path = folder / kRunFile;
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return std::nullopt;
  json document = json::parse(read_text_file(path), nullptr, false);
  if (!document.is_object() || document.value("schema", json()) != "kinescope.run") {
    return std::nullopt;
  }
  return document;
}

// Name and hash of every input that run.json lists.
std::vector<InputFile> inputs_of(const json& document) {
  std::vector<InputFile> out;
  for (const json& input : document.value("inputs", json::array())) {
    if (!input.is_object()) continue;
    const json name = input.value("name", json());
    const json sha256 = input.value("sha256", json());
    if (name.is_string() && sha256.is_string()) out.push_back({name, sha256});
  }
  return out;
}

// What was measured: one camera.yaml and one tags.yaml serve many recordings.
bool is_measured(const fs::path& input) {
  constexpr std::array<std::string_view, 4> kDeclared{".yaml", ".yml", ".xml", ".urdf"};
  return std::ranges::find(kDeclared, input.extension().string()) == kDeclared.end();
}

// A recording that was renamed or is worked on keeps its name or one of its measured files.
bool is_another_recording(const json& run, const Recording& recording) {
  const json name = run.value("recording", json());
  if (!name.is_string() || name == recording.name) return false;
  std::set<std::string> measured;
  for (const InputFile& input : inputs_of(run)) {
    if (is_measured(input.name)) measured.insert(input.sha256);
  }
  return std::ranges::none_of(hash_inputs(recording), [&](const InputFile& input) {
    return measured.contains(input.sha256);
  });
}

// The run's folder, if it may be written into.
fs::path checked_output(const RunOptions& options, const Recording& recording) {
  const fs::path folder =
      options.output.empty() ? fs::path(recording.name + "_run") : options.output;
  if (same_place(folder, recording.folder)) {
    throw bad_request(folder.string(), "is the recording's own folder",
                      "name another folder with --output, such as one inside it");
  }
  require_apart(folder, recording.files);
  const auto run = options.force ? std::nullopt : run_document(folder);
  if (run && is_another_recording(*run, recording)) {
    throw bad_request(folder.string(),
                      fmt::format("holds the run of another recording, {}",
                                  run->at("recording").get<std::string>()),
                      "name another folder with --output, or replace it with --force");
  }
  return folder;
}

std::string describe_geometry(const std::optional<FreeGeometry>& free) {
  if (!free) return "geometry; of a nominal robot what predicts best";
  switch (*free) {
    case FreeGeometry::kPlacement:
      return "placement";
    case FreeGeometry::kOffsets:
      return "offsets";
    case FreeGeometry::kGeometry:
      return "geometry";
  }
  return "unknown";
}

}  // namespace

RunFolder::RunFolder(const RunOptions& options, const Recording& recording)
    : OutputFolder(checked_output(options, recording),
                   {.command = "run",
                    .products = products_of(recording),
                    .inputs = {},  // none of them lies in the folder
                    .force = options.force}),
      detect_(options.detect),
      force_(options.force) {}

std::optional<TagObservations> RunFolder::cached_observations(const Recording& recording) const {
  if (force_) return std::nullopt;
  return read_kept_observations(file(""), recording, detect_);
}

void RunFolder::keep_observations(const Recording& recording, const TagObservations& observations) {
  for (const auto& [name, content] : kept_observations(recording, observations, detect_))
    write(name, content);
}

bool RunFolder::holds_answer() const {
  if (!fs::exists(file("robot.urdf"))) return false;
  if (!fs::exists(file("result.json"))) return true;
  const json result = json::parse(read_text_file(file("result.json")), nullptr, false);
  const json verdict = result.is_object() ? result.value("verdict", json()) : json();
  return !verdict.is_object() || verdict.value("answer", json(true)) != json(false);
}

void RunFolder::write(std::string_view name, std::string_view content) {
  OutputFolder::write(name, content);
  products_.emplace(name);
}

void RunFolder::begin_products() const {
  list_own_products();
  remove(kRunFile);
}

void RunFolder::add_products(const std::vector<std::string>& names) {
  products_.insert(names.begin(), names.end());
}

void RunFolder::remove_stale_products() const {
  // Only what a run writes, whatever the folder's list says.
  const std::vector<std::string> known = run_products(true);
  for (const std::string& name : own_products()) {
    if (!products_.contains(name) && std::ranges::find(known, name) != known.end()) remove(name);
  }
}

std::vector<std::pair<std::string, std::string>> list_options(const RunOptions& options) {
  const CalibrateOptions& c = options.calibrate;
  const DetectorOptions& d = options.detect.detector;
  return {{"free", describe_geometry(options.free)},
          {"estimate intrinsics", options.estimate_intrinsics ? "yes" : "when not declared"},
          {"estimate time offset", c.estimate_time_offset ? "yes" : "no"},
          {"estimate scales", c.estimate_scales ? "yes" : "when the unit is unknown"},
          {"nominal prior",
           fmt::format("{} mm, {:.3f} deg", 1e3 * c.nominal.m, c.nominal.rad / kRadPerDegree)},
          {"rejection", fmt::format("{} sigma", c.reject_sigma)},
          {"folds", fmt::format("{}", c.folds)},
          {"decimate", fmt::format("{}", d.decimate)},
          {"largest hamming distance",
           d.max_hamming ? fmt::format("{}", *d.max_hamming) : "the family's own"},
          {"least decision margin", fmt::format("{}", d.min_margin)},
          {"least sightings of a marker", fmt::format("{}", options.detect.min_sightings)}};
}

json run_json(const RunSummary& run, const std::set<std::string>& products) {
  json inputs = json::array();
  for (const InputFile& file : run.inputs) {
    inputs.push_back({{"name", file.name}, {"sha256", file.sha256}});
  }
  json options = json::object();
  for (const auto& [name, value] : run.options) options[name] = value;
  json times = json::array();
  for (const StageTime& time : run.times) {
    times.push_back({{"stage", time.stage}, {"seconds", time.seconds}});
  }
  return {{"schema", "kinescope.run"},
          {"schema_version", 1},
          {"program", "kinescope"},
          {"version", run.version},
          {"command", run.command},
          {"arguments", run.arguments},
          {"working_folder", run.working_folder},
          {"recording", run.recording},
          {"entry", run.entry},
          {"inputs", inputs},
          {"options", options},
          {"seed", nullptr},
          {"products", products},
          {"stages", std::move(times)}};
}

void require_same_inputs(const fs::path& run_folder, const Recording& recording) {
  const auto run = run_document(run_folder);
  const std::vector<InputFile> before = run ? inputs_of(*run) : std::vector<InputFile>{};
  const std::vector<InputFile> now = hash_inputs(recording);
  const auto refuse = [&](const InputFile& input, std::string_view what) {
    throw bad_input((recording.folder / input.name).string(),
                    fmt::format("{} the run in {}", what, run_folder.string()),
                    "run the recording again");
  };
  const auto holds = [](const std::vector<InputFile>& list, auto member, const InputFile& input) {
    return std::ranges::find(list, input.*member, member) != list.end();
  };
  for (const InputFile& input : now) {
    if (holds(before, &InputFile::sha256, input)) continue;
    refuse(input,
           holds(before, &InputFile::name, input) ? "has changed since" : "was not there for");
  }
  for (const InputFile& input : before) {
    if (!holds(now, &InputFile::sha256, input)) refuse(input, "is no longer used, but was for");
  }
}

void describe_input(const Recording& recording, const Observed& observed, const RunOptions& options,
                    RunSummary& run) {
  run.robot = recording.settings.name;
  run.recording = recording.name;
  run.entry = to_string(recording.entry);
  run.version = program_version();
  run.command = options.command_line;
  run.arguments = options.arguments;
  run.working_folder =
      (options.working_folder.empty() ? fs::current_path() : options.working_folder).string();
  run.inputs = hash_inputs(recording);
  run.options = list_options(options);
  run.frames = static_cast<int>(frame_times(observed).size());
  run.markers = summarise_markers(observed, recording.markers);
  run.warnings = recording.warnings;
  append_unsaid(run.warnings, observed.warnings);
}

RunAgain read_run_again(const fs::path& folder) {
  const fs::path path = folder / "run.json";
  const json document = json::parse(read_text_file(path), nullptr, false);
  RunAgain out;
  const bool complete =
      document.is_object() && document.value("schema", json()) == "kinescope.run" &&
      document.contains("arguments") && document.at("arguments").is_array() &&
      document.contains("working_folder") && document.at("working_folder").is_string();
  if (complete) {
    for (const json& word : document.at("arguments")) {
      if (word.is_string()) out.arguments.push_back(word.get<std::string>());
    }
    out.working_folder = document.at("working_folder").get<std::string>();
  }
  if (out.arguments.empty()) {
    throw bad_input(path.string(), "it does not say how the run was started",
                    "give the folder of a finished run, or run the recording again");
  }
  return out;
}

void resolve_paths(RecordingPaths& paths, const fs::path& from) {
  const auto resolve = [&](fs::path& path) {
    if (path.is_relative()) path = from / path;
  };
  resolve(paths.folder);
  for (auto* file : {&paths.video, &paths.joints, &paths.camera, &paths.tags, &paths.corners,
                     &paths.poses, &paths.points, &paths.nominal}) {
    if (*file) resolve(**file);
  }
}

}  // namespace kinescope
