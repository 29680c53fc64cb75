// SPDX-License-Identifier: Apache-2.0
//
// `kinescope capture`: a recording from a camera that runs, with a page that says what it lacks.
#include "app/commands/capture.h"

#include <cmath>
#include <csignal>
#include <cstdio>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/capture/live_capture.h"
#include "app/io/recording.h"
#include "calib/camera/camera_file.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

volatile std::sig_atomic_t interrupted = 0;

void note_interrupt(int) { interrupted = 1; }

/// Ctrl-C and the end of a service end the recording; a second one ends the program.
class Interrupts {
 public:
  Interrupts() {
    interrupted = 0;
    struct sigaction action{};
    action.sa_handler = note_interrupt;
    action.sa_flags = static_cast<int>(SA_RESETHAND);
    sigaction(SIGINT, &action, &old_int_);
    sigaction(SIGTERM, &action, &old_term_);
  }
  ~Interrupts() {
    sigaction(SIGINT, &old_int_, nullptr);
    sigaction(SIGTERM, &old_term_, nullptr);
  }
  Interrupts(const Interrupts&) = delete;
  Interrupts& operator=(const Interrupts&) = delete;

 private:
  struct sigaction old_int_{};
  struct sigaction old_term_{};
};

/// The file that is named, else that of the folder, where there is one.
std::optional<fs::path> named_or_there(const std::optional<fs::path>& named, const fs::path& file) {
  std::error_code error;
  if (named || !fs::exists(file, error)) return named;
  return file;
}

RecordingHead head_of(const CaptureOptions& options) {
  RecordingHead head;
  if (options.tags && (options.size_m || options.family)) {
    throw bad_request("--tags", "says the markers' family and sizes already",
                      "leave out --family and --size, or --tags");
  }
  if (!options.size_m) head.tags = named_or_there(options.tags, options.output / "tags.yaml");
  head.camera = named_or_there(options.camera, options.output / "camera.yaml");
  if (head.camera) static_cast<void>(read_camera(*head.camera));  // or it is found out too late
  if (head.tags) {
    head.markers = read_marker_set(*head.tags);
    return head;
  }
  if (!options.size_m) {
    throw bad_request("--size", "how large the markers are is not known",
                      "measure the edge of a black square: --size 0.04 (m), or --tags tags.yaml");
  }
  head.markers.default_size_m = *options.size_m;
  if (options.family) head.markers.family = *options.family;
  return head;
}

void print_capture(const CaptureStatus& status) {
  const CaptureGuide& guide = status.guide;
  fmt::print("recorded  {} frames in {:.1f} s: {}\n", status.recorded, status.seconds, status.end);
  fmt::print("looked at {} frames, {} of use, stamps of the {}\n", guide.frames, guide.used,
             status.stamps);
  for (const auto& [refusal, frames] : guide.refused)
    fmt::print("refused   {} frames: {}\n", frames, to_string(refusal));
  for (const auto& [id, tally] : guide.markers) {
    fmt::print(
        "  tag {:<5} {:>4} frames, {:>4} of use, {:5.1f} px wide, tilted by {:.0f} degrees "
        "at most\n",
        id.value, tally.frames, tally.used, median_of(tally.edges_px), tally.most_tilt_deg);
  }
  fmt::print("image     {:.0f} % covered\n", 100.0 * covered_share(guide.grid));
  if (guide.rows > 0)
    fmt::print("joints    {} rows, stamps of the {}\n", guide.rows, status.joint_stamps);
  for (const ChannelTally& channel : guide.channels) {
    fmt::print("  joint {} from {:.4g} to {:.4g}, {}\n", channel.name, channel.span.lower,
               channel.span.upper, guess_unit(channel.span));
  }
  for (const std::string& line : status.missing) fmt::print("missing   {}\n", line);
  fmt::print(
      "{}: {}\n", status.folder,
      status.missing.empty() ? "will do; kinescope run reads it" : "recorded; see what is missing");
}

CaptureCalls calls_of(const CaptureOptions& options, const Console& console) {
  CaptureCalls out;
  out.interrupted = [] { return interrupted != 0; };
  out.page = [&console](const std::string& url) {
    if (console.json) {
      console.warn("the page is at " + url);
    } else {
      fmt::print("page      {}\n", url);
      std::fflush(stdout);
    }
  };
  out.warning = [&console](const std::string& text) { console.warn(text); };
  const int total = options.seconds ? static_cast<int>(std::ceil(*options.seconds)) : 0;
  out.recorded = [&console, total](double seconds) {
    report_progress(console.progress, "capture, s", static_cast<int>(seconds), total);
  };
  return out;
}

}  // namespace

ExitCode capture_command(const CaptureOptions& options, const Console& console) {
  CaptureRequest request;
  request.source = options.source;
  request.folder = options.output;
  request.head = head_of(options);
  request.find_family = !request.head.tags && !options.family;
  request.joints = options.joints;
  if (!options.no_page) request.port = options.port;
  request.seconds = options.seconds;
  require_room_for_recording(options.output, options.force);
  const Interrupts interrupts;
  const CaptureOutcome outcome = capture(request, calls_of(options, console));
  const CaptureStatus& status = outcome.status;
  if (status.recorded == 0 && !outcome.failed) {
    throw undetermined(options.output.string(), "nothing was recorded: " + status.end,
                       "press Start on the page, or leave the page out with --no-page");
  }
  if (console.json) {
    console.print(capture_json(status));
  } else {
    print_capture(status);
  }
  if (outcome.failed) throw Error(*outcome.failed);
  return status.guide.markers.empty() ? ExitCode::kUndetermined : ExitCode::kDone;
}

}  // namespace kinescope
