// SPDX-License-Identifier: Apache-2.0
//
// Several recordings of random robots through the user's command, together and each alone, against
// their truth:
//   many_recordings [--seeds N] [--first-seed N] [--robot KIND] [--recordings N] [--seconds S]
//                   [--zero DEGREES] [--anew] [--keep FOLDER]
// One line a run: exit code, structure, the axes' claimed and true errors, error on unseen data.
// Cameras stand up to 60 degrees apart, clocks differ by 0.3 s, noise is 0.1, 0.2, 0.1 px, motions
// are others. --zero: the second joint's zero moves by as much behind the first recording. --anew:
// the marker of the second link is stuck on anew there.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/commands/commands.h"
#include "tests/experiments/command_line.h"
#include "tests/experiments/judged_run.h"
#include "tests/truth/recordings_world.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using truth::RecordingOptions;
using truth::RobotKind;

struct Request {
  int seeds = 1;
  int first_seed = 0;
  int recordings = 2;
  double seconds = 12.0;
  std::vector<RobotKind> kinds{truth::kRobotKinds.begin(), truth::kRobotKinds.end()};
  double zero_deg = 0.0;
  bool anew = false;
  fs::path keep;
};

truth::FilmedRobotOptions robot_of(RobotKind kind, int seed, const Request& request) {
  truth::FilmedRobotOptions out;
  out.seed = 9000 + static_cast<std::uint64_t>(seed);
  out.kind = kind;
  out.duration_s = request.seconds;
  out.tag_size_m = 0.06;
  out.scale = 1.5;
  out.distance_m = 1.6;
  return out;
}

std::vector<RecordingOptions> recordings_of(int seed, const Request& request) {
  std::vector<RecordingOptions> out(static_cast<std::size_t>(request.recordings));
  const std::vector<std::string> names{"monday", "tuesday", "wednesday"};
  const std::vector<truth::RigCamera> cameras{
      {.name = {}, .clock_s = 0.05},
      {.name = {}, .azimuth_rad = 0.6, .clock_s = -0.25, .rate_hz = 25.0, .sigma_px = 0.2},
      {.name = {}, .azimuth_rad = -0.4, .clock_s = 0.2, .rate_hz = 20.0}};
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k].name = names[k];
    out[k].motion = 10 * static_cast<std::uint64_t>(seed) + k;
    out[k].camera = cameras[k];
    if (k == 0) continue;
    if (request.zero_deg != 0.0) out[k].zeros[1] = request.zero_deg * std::numbers::pi / 180.0;
    if (request.anew) {
      Pose elsewhere;
      elsewhere.rotation = exp_rotation({0.1, -0.05, 0.6 * static_cast<double>(k)});
      elsewhere.translation = {0.012, -0.008, 0.002};
      out[k].moved[12] = elsewhere;
    }
  }
  return out;
}

struct Sums {
  int robots = 0, right = 0, alone = 0, alone_right = 0, within = 0, axes = 0;
  std::vector<double> claims, errors;  // together over the best alone
  std::vector<double> information;     // together over what the recordings alone say together
};

void one_robot(RobotKind kind, int seed, const Request& request, Sums& sums) {
  const std::vector<RecordingOptions> recordings = recordings_of(seed, request);
  const std::vector<truth::World> worlds =
      truth::make_recordings(robot_of(kind, seed, request), recordings);
  const fs::path root =
      (request.keep.empty() ? truth::temporary_path("many_recordings") : request.keep) /
      fmt::format("{}_{}", to_string(kind), seed);
  const std::vector<fs::path> folders = truth::write_recordings(worlds, recordings, root);
  const std::string name = fmt::format("{}_{}", to_string(kind), seed);
  const KinematicTree& truth = worlds.front().tree;
  RunOptions all;
  all.recording.folder = folders.front();
  all.further.assign(folders.begin() + 1, folders.end());
  const JudgedRun together = judged_run(all, root / "together_run", truth);
  print_line(name + " together", together);
  ++sums.robots;
  sums.right += together.structure;
  sums.within += together.within;
  sums.axes += together.axes;
  std::optional<JudgedRun> best;
  double information = 0.0;
  for (std::size_t k = 0; k < folders.size(); ++k) {
    RunOptions alone;
    alone.recording.folder = folders[k];
    const JudgedRun one = judged_run(alone, root / (recordings[k].name + "_run"), worlds[k].tree);
    print_line(fmt::format("{} {}", name, recordings[k].name), one);
    ++sums.alone;
    sums.alone_right += one.structure;
    if (!one.structure || one.claimed_mm <= 0.0) continue;
    information += 1.0 / (one.claimed_mm * one.claimed_mm);
    if (!best || one.claimed_mm < best->claimed_mm) best = one;
  }
  if (!best || !together.structure || together.claimed_mm <= 0.0) return;
  sums.claims.push_back(together.claimed_mm / best->claimed_mm);
  sums.errors.push_back(together.true_mm / best->true_mm);
  sums.information.push_back(together.claimed_mm * std::sqrt(information));
}

void run_all(const Request& request) {
  print_header("recording");
  Sums sums;
  for (int seed = request.first_seed; seed < request.first_seed + request.seeds; ++seed)
    for (const RobotKind kind : request.kinds) one_robot(kind, seed, request, sums);
  fmt::print(
      "SUMMARY structure right: together {} of {}, alone {} of {}; places of axes within twice "
      "the standard uncertainty: {} of {}\n",
      sums.right, sums.robots, sums.alone_right, sums.alone, sums.within, sums.axes);
  fmt::print(
      "SUMMARY together over the best alone, rms: uncertainty {:.2f}, error {:.2f}; uncertainty "
      "over that of all alone weighted by it: {:.2f} ({} robots)\n",
      rms(sums.claims), rms(sums.errors), rms(sums.information), sums.claims.size());
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using namespace kinescope;
  Request request;
  std::string kind;
  CLI::App app("Several recordings together against each of them alone");
  app.add_option("--seeds", request.seeds);
  app.add_option("--first-seed", request.first_seed);
  app.add_option("--robot", kind);
  app.add_option("--recordings", request.recordings)->check(CLI::Range(2, 3));
  app.add_option("--seconds", request.seconds);
  app.add_option("--zero", request.zero_deg);
  app.add_flag("--anew", request.anew);
  app.add_option("--keep", request.keep);
  return run_experiment(app, argc, argv, [&] {
    if (!kind.empty())
      std::erase_if(request.kinds, [&](RobotKind k) { return to_string(k) != kind; });
    run_all(request);
  });
}
