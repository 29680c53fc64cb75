// SPDX-License-Identifier: Apache-2.0
//
// Random robots before two or three cameras, through the user's command, together and each camera
// alone, against their truth:
//   several_cameras [--seeds N] [--first-seed N] [--robot KIND] [--cameras N] [--seconds S]
//                   [--split] [--bump DEGREES] [--keep FOLDER]
// One line a run: exit code, structure, the axes' claimed and true errors, error on unseen data.
// Clocks of the cameras are up to 0.4 s apart, their rates 30, 25 and 20 Hz, noise 0.1 px. --split:
// every second link's marker faces the second camera. --bump: camera 1 turns by as much in the
// middle of the recording.
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/commands/commands.h"
#include "tests/experiments/command_line.h"
#include "tests/experiments/judged_run.h"
#include "tests/truth/rig_world.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using truth::RobotKind;

struct Request {
  int seeds = 1;
  int first_seed = 0;
  int cameras = 2;
  double seconds = 12.0;
  std::vector<RobotKind> kinds{truth::kRobotKinds.begin(), truth::kRobotKinds.end()};
  bool split = false;
  double bump_deg = 0.0;
  fs::path keep;
};

truth::RigOptions rig_of(RobotKind kind, int seed, const Request& request) {
  truth::RigOptions out;
  out.robot.seed = 7000 + static_cast<std::uint64_t>(seed);
  out.robot.kind = kind;
  out.robot.duration_s = request.seconds;
  out.robot.tag_size_m = 0.06;
  out.robot.scale = 1.5;
  out.robot.distance_m = 1.6;
  const std::vector<truth::RigCamera> all{
      {.name = "front", .clock_s = 0.05},
      {.name = "left", .azimuth_rad = 0.6, .clock_s = -0.35, .rate_hz = 25.0},
      {.name = "right", .azimuth_rad = -0.6, .clock_s = 0.2, .rate_hz = 20.0}};
  out.cameras.assign(all.begin(), all.begin() + request.cameras);
  if (request.bump_deg != 0.0) {
    out.cameras[1].bumped_s = 0.5 * request.seconds;
    out.cameras[1].bump_rad = request.bump_deg * std::numbers::pi / 180.0;
  }
  if (!request.split) return out;
  out.cameras[1].azimuth_rad = 1.4;  // beyond what a marker shows of itself to both
  for (int id = 12; id < 20; id += 2) out.faces[id] = 1;
  return out;
}

struct Sums {
  int recordings = 0, together_right = 0, alone = 0, alone_right = 0, within = 0, axes = 0;
  std::vector<double> ratios;  // of claimed uncertainties, together over the best alone
  std::vector<double> true_ratios;
};

void one_recording(RobotKind kind, int seed, const Request& request, Sums& sums) {
  const truth::RigOptions rig = rig_of(kind, seed, request);
  const std::vector<truth::World> worlds = truth::make_rig_worlds(rig);
  const fs::path root =
      request.keep.empty() ? truth::temporary_path("several_cameras") : request.keep;
  const std::string name = fmt::format("{}_{}", to_string(kind), seed);
  const fs::path folder = root / name;
  truth::write_rig(worlds, rig, folder);
  const KinematicTree& truth = worlds.front().tree;
  RunOptions all;
  all.recording.folder = folder;
  const JudgedRun together = judged_run(all, root / (name + "_run"), truth);
  print_line(name + " together", together);
  ++sums.recordings;
  sums.together_right += together.structure;
  sums.within += together.within;
  sums.axes += together.axes;
  std::optional<JudgedRun> best;
  for (const truth::RigCamera& camera : rig.cameras) {
    RunOptions alone = all;
    alone.recording.corners = folder / fmt::format("corners_{}.csv", camera.name);
    alone.recording.camera = folder / fmt::format("camera_{}.yaml", camera.name);
    const JudgedRun one =
        judged_run(alone, root / fmt::format("{}_{}_run", name, camera.name), truth);
    print_line(fmt::format("{} {}", name, camera.name), one);
    ++sums.alone;
    sums.alone_right += one.structure;
    if (one.structure && (!best || one.claimed_mm < best->claimed_mm)) best = one;
  }
  if (!best || !together.structure || best->claimed_mm <= 0.0) return;
  sums.ratios.push_back(together.claimed_mm / best->claimed_mm);
  sums.true_ratios.push_back(together.true_mm / best->true_mm);
}

void run_all(const Request& request) {
  print_header("recording");
  Sums sums;
  for (int seed = request.first_seed; seed < request.first_seed + request.seeds; ++seed)
    for (const RobotKind kind : request.kinds) one_recording(kind, seed, request, sums);
  fmt::print(
      "SUMMARY structure right: together {} of {}, alone {} of {}; places of axes within twice "
      "the standard uncertainty: {} of {}\n",
      sums.together_right, sums.recordings, sums.alone_right, sums.alone, sums.within, sums.axes);
  fmt::print(
      "SUMMARY together over the best camera alone, rms: uncertainty {:.2f}, error {:.2f} ({} "
      "recordings)\n",
      rms(sums.ratios), rms(sums.true_ratios), sums.ratios.size());
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using namespace kinescope;
  Request request;
  std::string kind;
  CLI::App app("Several cameras together against each of them alone");
  app.add_option("--seeds", request.seeds);
  app.add_option("--first-seed", request.first_seed);
  app.add_option("--robot", kind);
  app.add_option("--cameras", request.cameras)->check(CLI::Range(2, 3));
  app.add_option("--seconds", request.seconds);
  app.add_flag("--split", request.split);
  app.add_option("--bump", request.bump_deg);
  app.add_option("--keep", request.keep);
  return run_experiment(app, argc, argv, [&] {
    if (!kind.empty())
      std::erase_if(request.kinds, [&](truth::RobotKind k) { return to_string(k) != kind; });
    run_all(request);
  });
}
