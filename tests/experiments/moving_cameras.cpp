// SPDX-License-Identifier: Apache-2.0
//
// Random robots with a camera on the last link before a wall of markers, or in a person's hand,
// through the user's command against their truth:
//   moving_cameras [--seeds N] [--first-seed N] [--robot KIND] [--carrier robot|person]
//                  [--seconds S] [--declare] [--keep FOLDER]
// One line a run: exit code, structure, the axes' claimed and true errors, error on unseen data.
// The camera's clock is 0.1 s behind, noise 0.1 px. --declare: camera_mount stands in
// recording.yaml; without it the recording has to show how the camera moves.
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/commands/commands.h"
#include "kinematics/core/file.h"
#include "tests/experiments/command_line.h"
#include "tests/experiments/judged_run.h"
#include "tests/truth/moving_camera_world.h"
#include "tests/truth/recorded_world.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using truth::CameraCarrier;
using truth::RobotKind;

struct Request {
  int seeds = 1;
  int first_seed = 0;
  double seconds = 20.0;
  std::vector<RobotKind> kinds{truth::kAllRobotKinds.begin(), truth::kAllRobotKinds.end()};
  std::vector<CameraCarrier> carriers{CameraCarrier::kRobot, CameraCarrier::kPerson};
  bool declare = false;
  fs::path keep;
};

const char* word_of(CameraCarrier carrier) {
  return carrier == CameraCarrier::kRobot ? "robot" : "person";
}

truth::MovingCameraOptions world_of(RobotKind kind, CameraCarrier carrier, int seed,
                                    const Request& request) {
  truth::MovingCameraOptions out;
  out.robot.seed = 7000 + static_cast<std::uint64_t>(seed);
  out.robot.kind = kind;
  out.robot.duration_s = request.seconds;
  out.robot.tag_size_m = 0.06;
  out.robot.scale = 1.5;
  out.robot.distance_m = 1.6;
  out.carrier = carrier;
  // A hand's turns add up along the arm, and the wall has to stay in view.
  if (carrier == CameraCarrier::kRobot) out.robot.amplitude_rad = 0.5;
  out.clock_s = 0.1;
  return out;
}

struct Sums {
  int recordings = 0, right = 0, within = 0, axes = 0;
};

void one_recording(RobotKind kind, CameraCarrier carrier, int seed, const Request& request,
                   Sums& sums) {
  const truth::MovingCameraWorld filmed =
      truth::make_moving_camera_world(world_of(kind, carrier, seed, request));
  const fs::path root =
      request.keep.empty() ? truth::temporary_path("moving_cameras") : request.keep;
  const std::string name = fmt::format("{}_{}_{}", to_string(kind), word_of(carrier), seed);
  const fs::path folder = root / name;
  truth::write_world(filmed.world, folder);
  if (request.declare) {
    write_file_atomically(
        folder / "recording.yaml",
        fmt::format("camera_mount: {}\n", carrier == CameraCarrier::kRobot ? "hand" : "carried"));
  }
  RunOptions options;
  options.recording.folder = folder;
  const JudgedRun judged =
      judged_run(options, root / (name + "_run"), filmed.world.tree, Markers::kThoseFound);
  print_line(name, judged);
  ++sums.recordings;
  sums.right += judged.structure;
  sums.within += judged.within;
  sums.axes += judged.axes;
}

void run_all(const Request& request) {
  print_header("recording");
  for (const CameraCarrier carrier : request.carriers) {
    Sums sums;
    for (int seed = request.first_seed; seed < request.first_seed + request.seeds; ++seed)
      for (const RobotKind kind : request.kinds) one_recording(kind, carrier, seed, request, sums);
    fmt::print(
        "SUMMARY {}: structure right {} of {}; places of axes within twice the standard "
        "uncertainty: {} of {}\n",
        word_of(carrier), sums.right, sums.recordings, sums.within, sums.axes);
  }
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using namespace kinescope;
  Request request;
  std::string kind;
  std::string carrier;
  CLI::App app("A camera on the robot, and one in a person's hand");
  app.add_option("--seeds", request.seeds);
  app.add_option("--first-seed", request.first_seed);
  app.add_option("--robot", kind);
  app.add_option("--carrier", carrier)->check(CLI::IsMember({"robot", "person"}));
  app.add_option("--seconds", request.seconds);
  app.add_flag("--declare", request.declare);
  app.add_option("--keep", request.keep);
  return run_experiment(app, argc, argv, [&] {
    if (!kind.empty())
      std::erase_if(request.kinds, [&](truth::RobotKind k) { return to_string(k) != kind; });
    if (!carrier.empty())
      std::erase_if(request.carriers, [&](auto c) { return word_of(c) != carrier; });
    run_all(request);
  });
}
