// SPDX-License-Identifier: Apache-2.0
//
// `kinescope inspect`: reads everything that can be read, says what is there, then a verdict.
#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/commands/inspect_bag.h"
#include "app/commands/inspect_dataset.h"
#include "app/commands/inspection.h"
#include "app/explain/nominal_channels.h"
#include "app/explain/sighting_doubts.h"
#include "calib/vision/repeated_frames.h"
#include "kinematics/bags/bag.h"
#include "kinematics/datasets/dataset.h"
#include "kinematics/recorded/container.h"

namespace kinescope {
namespace {

std::vector<std::string> file_names(const Recording& recording) {
  constexpr std::size_t kMost = 8;  // a folder of images has thousands
  std::vector<std::string> names;
  for (const auto& path : recording.files) {
    if (names.size() < kMost) names.push_back(path.filename().string());
  }
  if (recording.files.size() > kMost) {
    names.push_back(fmt::format(".. {} files in all", recording.files.size()));
  }
  return names;
}

void print_video(const Recording& recording, const VideoFacts& video) {
  fmt::print("video     {}: {} x {}, {}, {:.3f} frames/s\n", recorded::short_name(recording.video),
             video.info.width, video.info.height,
             video.info.codec.empty() ? "codec unknown" : video.info.codec, video.frame_rate_hz);
  const double last_s = video.times_s.empty() ? 0.0 : video.times_s.back();
  const double first_s = video.times_s.empty() ? 0.0 : video.times_s.front();
  fmt::print(
      "          {} frames from {:.3f} to {:.3f} s{}\n", video.frames_decoded, first_s, last_s,
      video.decoded_to_end ? ""
                           : fmt::format(" looked at, of {:.1f} s in all", video.info.duration_s));
  fmt::print("markers   {} seen in {} frames searched\n", video.markers.size(),
             video.frames_searched);
  for (const MarkerFacts& marker : video.markers) {
    fmt::print(
        "  tag {:<5} {:>3} frames, {:5.1f} px wide, contrast {:3.0f}, blur {:.1f} px, {}\n",
        marker.id.value, marker.frames, marker.edge_px, marker.contrast, marker.blur_px,
        marker.size_m > 0.0 ? fmt::format("{:g} mm", 1e3 * marker.size_m) : "no size declared");
  }
}

void print_log(const LogFacts& log) {
  fmt::print(
      "joints    {} channels, {} samples from {:.3f} to {:.3f} s, {:.1f} Hz, jitter {:.2f} ms, "
      "longest gap {:.0f} ms\n",
      log.channels.size(), log.samples, log.first_s, log.last_s, log.rate_hz, 1e3 * log.jitter_s,
      1e3 * log.longest_gap_s);
  for (const ChannelFacts& channel : log.channels) {
    fmt::print("  {:<10} {:10.4f} to {:10.4f}  {}{}\n", channel.name, channel.lower, channel.upper,
               channel.unit, channel.moves ? "" : ", never changes");
  }
}

void print_sightings(const Recording& recording) {
  if (recording.corners) {
    fmt::print("corners   {} sightings in {} frames\n", recording.corners->observations.size(),
               recording.corners->times_s.size());
  }
  if (recording.poses) {
    fmt::print("poses     {} bodies in {} frames\n", recording.poses->tracks.size(),
               recording.poses->times_s.size());
  }
  if (recording.points) {
    fmt::print("points    {} sightings in {} frames\n", recording.points->observations.size(),
               recording.points->times_s.size());
  }
}

void print_flange(const Recording& recording) {
  const PoseLog& log = recording.flange.front().log;
  fmt::print(
      "flange    {} poses, {} from {:g} to {:g}{}, {}: `run` calibrates the camera to the "
      "hand\n",
      log.poses.size(), log.time_column, log.times_s.front(), log.times_s.back(),
      log.numbered ? "" : " s", recording.flange.front().rotation);
  for (std::size_t k = 1; k < recording.flange.size(); ++k) {
    if (!recording.flange[k].usual) continue;
    fmt::print("          or read as {}: `run` tells\n", recording.flange[k].rotation);
  }
}

void print_inspection(const Inspection& inspection) {
  const Recording& recording = inspection.recording;
  fmt::print("recording {} ({}): {}\n", recording.settings.name, to_string(recording.entry),
             fmt::join(file_names(recording), ", "));
  if (inspection.video) print_video(recording, *inspection.video);
  print_sightings(recording);
  for (const Inspection& one : inspection.cameras) {
    fmt::print("camera    {}{}\n", one.recording.camera_name,
               one.recording.camera ? "" : ", intrinsics to be estimated");
    if (one.video) print_video(one.recording, *one.video);
    print_sightings(one.recording);
  }
  if (recording.settings.camera_mount)
    fmt::print("mount     {}, as declared\n", to_string(*recording.settings.camera_mount));
  if (inspection.log) print_log(*inspection.log);
  if (!recording.flange.empty()) print_flange(recording);
  if (recording.camera) {
    fmt::print("camera    {} x {}, focal length {:.1f} px, {}\n", recording.camera->width,
               recording.camera->height, recording.camera->fx, to_string(recording.camera->model));
  }
  if (recording.nominal) {
    fmt::print("nominal   {}: {} links, {} joints\n", recording.nominal->name,
               recording.nominal->links.size(), recording.nominal->joints.size());
  }
  for (const Finding& finding : inspection.findings) {
    fmt::print("{} {}\n", finding.problem ? "problem  " : "note     ", finding.text);
  }
  const auto problems = std::ranges::count(inspection.findings, true, &Finding::problem);
  fmt::print("verdict   {}\n", inspection.ready() ? "ready to run"
                                                  : fmt::format("not ready: {} problem{}", problems,
                                                                problems == 1 ? "" : "s"));
}

nlohmann::json video_json(const VideoFacts& video) {
  nlohmann::json markers = nlohmann::json::array();
  for (const MarkerFacts& marker : video.markers) {
    markers.push_back({{"id", marker.id.value},
                       {"size_m", marker.size_m},
                       {"frames", marker.frames},
                       {"edge_px", marker.edge_px},
                       {"contrast", marker.contrast},
                       {"blur_px", marker.blur_px}});
  }
  return {{"width", video.info.width},
          {"height", video.info.height},
          {"codec", video.info.codec},
          {"declared_frames", video.info.frame_count},
          {"declared_duration_s", video.info.duration_s},
          {"frames_decoded", video.frames_decoded},
          {"decoded_to_end", video.decoded_to_end},
          {"first_s", video.times_s.empty() ? 0.0 : video.times_s.front()},
          {"last_s", video.times_s.empty() ? 0.0 : video.times_s.back()},
          {"frame_rate_hz", video.frame_rate_hz},
          {"longest_step_s", video.longest_step_s},
          {"frames_searched", video.frames_searched},
          {"markers", markers}};
}

nlohmann::json log_json(const LogFacts& log) {
  nlohmann::json channels = nlohmann::json::array();
  for (const ChannelFacts& channel : log.channels) {
    channels.push_back({{"name", channel.name},
                        {"unit", channel.unit},
                        {"lower", channel.lower},
                        {"upper", channel.upper},
                        {"moves", channel.moves}});
  }
  return {{"samples", log.samples},
          {"first_s", log.first_s},
          {"last_s", log.last_s},
          {"rate_hz", log.rate_hz},
          {"jitter_s", log.jitter_s},
          {"longest_gap_s", log.longest_gap_s},
          {"longest_gap_at_s", log.longest_gap_at_s},
          {"channels", channels}};
}

nlohmann::json flange_json(const Recording& recording) {
  const PoseLog& log = recording.flange.front().log;
  nlohmann::json readings = nlohmann::json::array();
  for (const FlangeReading& reading : recording.flange)
    if (reading.usual) readings.push_back(reading.rotation);
  return {{"poses", log.poses.size()},  {"time_column", log.time_column},
          {"numbered", log.numbered},   {"first", log.times_s.front()},
          {"last", log.times_s.back()}, {"rotations", readings}};
}

nlohmann::json inspection_json(const Inspection& inspection) {
  const Recording& recording = inspection.recording;
  nlohmann::json out = {{"schema", 1},
                        {"recording", recording.settings.name},
                        {"entry", to_string(recording.entry)},
                        {"ready", inspection.ready()},
                        {"camera_declared", recording.camera.has_value()},
                        {"nominal", recording.nominal.has_value()},
                        {"files", nlohmann::json::array()},
                        {"problems", nlohmann::json::array()},
                        {"notes", nlohmann::json::array()}};
  for (const auto& path : recording.files) out["files"].push_back(path.filename().string());
  for (const Finding& finding : inspection.findings) {
    out[finding.problem ? "problems" : "notes"].push_back(finding.text);
  }
  if (inspection.video) out["video"] = video_json(*inspection.video);
  for (const Inspection& one : inspection.cameras) {
    nlohmann::json camera = {{"name", one.recording.camera_name},
                             {"camera_declared", one.recording.camera.has_value()}};
    if (one.video) camera["video"] = video_json(*one.video);
    if (one.recording.corners) camera["sightings"] = one.recording.corners->observations.size();
    out["cameras"].push_back(std::move(camera));
  }
  if (inspection.log) out["log"] = log_json(*inspection.log);
  if (!recording.flange.empty()) out["flange"] = flange_json(recording);
  return out;
}

void note_what_is_missing(Inspection& inspection) {
  const Recording& recording = inspection.recording;
  const bool by_image =
      recording.entry == RecordingEntry::kVideo || recording.entry == RecordingEntry::kCorners;
  for (const Inspection& one : inspection.cameras) {
    const std::string& name = one.recording.camera_name;
    if (one.recording.camera) continue;
    inspection.findings.push_back(
        {false, fmt::format("no camera_{}.yaml: its intrinsics are estimated too; `kinescope "
                            "camera` does it better",
                            name)});
  }
  if (by_image && !recording.camera && inspection.cameras.empty()) {
    inspection.findings.push_back(
        {false,
         "no camera.yaml: the intrinsics are estimated too; `kinescope camera` does it better"});
  }
  if (recording.log.empty() && !recording.nominal && recording.flange.empty()) {
    inspection.findings.push_back(
        {false, "no joints.csv: the structure is found from the markers alone"});
  }
  if (recording.entry == RecordingEntry::kPoints && !recording.nominal) {
    inspection.findings.push_back(
        {true,
         "points alone do not show a structure: give a nominal robot with --nominal robot.urdf"});
  }
}

// The nominal robot's joints and the log's columns, as `run` would match them.
void look_at_nominal(const Recording& recording, std::vector<Finding>& findings) {
  try {
    for (const std::string& warning : match_channels(recording).warnings) {
      findings.push_back({false, warning});
    }
  } catch (const Error& error) {
    findings.push_back({true, error.what()});
  }
}

// What of the sightings is not used, as `run` says it; of a video its own look says so.
void look_at_sightings(const Recording& recording, std::vector<Finding>& findings) {
  const std::vector<double>* times_s = recording.corners  ? &recording.corners->times_s
                                       : recording.poses  ? &recording.poses->times_s
                                       : recording.points ? &recording.points->times_s
                                                          : nullptr;
  if (times_s == nullptr) return;
  constexpr std::size_t kFew = 10;
  if (times_s->size() < kFew) {
    findings.push_back({false, fmt::format("{} frame{} only: nothing can be told of how the "
                                           "markers move; record while every joint moves",
                                           times_s->size(), times_s->size() == 1 ? "" : "s")});
  }
  std::vector<std::string> words = uncovered_words(recording.log, *times_s);
  if (recording.corners) {
    TagObservations tags = *recording.corners;
    leave_out_repeated_frames(tags);
    for (const std::vector<std::string>& more :
         {unlisted_marker_words(tags), repeated_frame_words(tags)})
      words.insert(words.end(), more.begin(), more.end());
  }
  for (std::string& sentence : words) findings.push_back({false, std::move(sentence)});
}

Inspection look_at_camera(const Recording& recording, const RecordedCamera& camera,
                          const Progress& progress, std::vector<Finding>& findings) {
  Inspection out;
  out.recording = of_camera(recording, camera);
  if (camera.video.empty()) return out;
  try {
    out.video = look_at_video(out.recording, progress, out.findings);
  } catch (const Error& error) {
    out.findings.push_back({true, error.what()});
  }
  for (const Finding& finding : out.findings)
    findings.push_back({finding.problem, fmt::format("camera {}: {}", camera.name, finding.text)});
  return out;
}

}  // namespace

bool Inspection::ready() const { return std::ranges::none_of(findings, &Finding::problem); }

Inspection inspect_recording(const RecordingPaths& paths, const Progress& progress) {
  ReadAttempt attempt = try_read_recording(paths);
  Inspection inspection;
  inspection.recording = std::move(attempt.recording);
  const Recording& recording = inspection.recording;
  std::vector<Finding>& findings = inspection.findings;
  for (const Error& error : attempt.errors) {
    // Not the recording but the command line is wrong.
    if (error.code() == ExitCode::kBadRequest) throw Error(error);
    findings.push_back({true, error.what()});
  }
  for (const std::string& warning : recording.warnings) findings.push_back({false, warning});
  if (recording.files.empty()) return inspection;
  if (!recording.log.empty())
    inspection.log = look_at_log(recording.log, recording.settings, findings);
  for (const RecordedCamera& camera : recording.cameras)
    inspection.cameras.push_back(look_at_camera(recording, camera, progress, findings));
  if (!recording.video.empty()) {
    try {
      inspection.video = look_at_video(recording, progress, findings);
    } catch (const Error& error) {
      findings.push_back({true, error.what()});
    }
  }
  if (!attempt.errors.empty()) return inspection;
  if (recording.nominal) look_at_nominal(recording, findings);
  look_at_sightings(recording, findings);
  note_what_is_missing(inspection);
  return inspection;
}

namespace {

/// What a bag or a dataset holds, beside the recording or log in it.
class ContainerLook {
 public:
  explicit ContainerLook(const std::filesystem::path& path)
      : path_(path), dataset_(datasets::dataset_source(path)) {
    if (const auto bag = bags::bag_source(path)) contents_ = &bags::look_into(bag->bag);
  }

  void print() const {
    if (contents_ != nullptr) print_topics(*contents_);
    if (dataset_) print_dataset(datasets::look_into(dataset_->folder), *dataset_);
  }

  /// Those that come with no recording.
  void print_warnings(const Console& console) const {
    if (contents_ == nullptr || !contents_->joints.empty()) return;
    for (const std::string& warning : contents_->warnings) console.warn(warning);
  }

  /// Joints alone, for `dynamics`; a table is that, too.
  [[nodiscard]] bool is_log() const {
    if (contents_ != nullptr) return !shows_robot(*contents_);
    if (dataset_) return !datasets::shows_robot(datasets::look_into(dataset_->folder));
    return std::filesystem::is_regular_file(path_);
  }

  void add_to(nlohmann::json& document) const {
    if (contents_ != nullptr) document["topics"] = topics_json(*contents_);
    if (dataset_) document["dataset"] = dataset_json(datasets::look_into(dataset_->folder));
  }

 private:
  std::filesystem::path path_;
  const bags::Contents* contents_ = nullptr;
  std::optional<datasets::Source> dataset_;
};

}  // namespace

ExitCode inspect_command(const InspectOptions& options, const Console& console) {
  const ContainerLook container(options.recording.folder);
  if (!console.json) container.print();
  container.print_warnings(console);
  const auto print_json = [&](nlohmann::json document) {
    container.add_to(document);
    console.print(document);
  };
  if (container.is_log()) {
    const TorqueLogFacts facts = look_at_torques(options);
    if (console.json) {
      print_json(torque_log_json(facts));
    } else {
      print_torque_log(facts);
    }
    return facts.ready() ? ExitCode::kDone : ExitCode::kBadInput;
  }
  const Inspection inspection = inspect_recording(options.recording, console.progress);
  if (console.json) {
    print_json(inspection_json(inspection));
  } else {
    print_inspection(inspection);
  }
  return inspection.ready() ? ExitCode::kDone : ExitCode::kBadInput;
}

}  // namespace kinescope
