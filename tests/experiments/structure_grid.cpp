// SPDX-License-Identifier: Apache-2.0
//
// Structure identification on simulated pose tracks: the 2019 tests and find_structure on identical
// recordings. Usage: structure_grid [trials a cell, default 10] [part of the cells' names]
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "kinematics/structure/structure.h"
#include "tests/experiments/anchor_2019.h"
#include "tests/experiments/structure_check.h"
#include "tests/truth/random_robot.h"

namespace kinescope {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

struct Cell {
  std::string name;
  RandomRobotOptions robot;
  RecordingOptions recording;
};

struct Tally {
  int trials = 0;
  int anchor_right = 0;
  int right = 0;
  int sure = 0;
  int sure_wrong = 0;
  double anchor_ms = 0.0;
  double ms = 0.0;
};

double milliseconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

void explain(const Cell& cell, int trial, const Structure& found, const RandomRobot& robot,
             const RobotRecording& recording) {
  fmt::print(
      "    wrong: {} trial {}  p={:.4f} log-odds {:.1f} lag {:.3f}  status {}  runner-up: {}\n",
      cell.name, trial, found.probability, found.runner_up_log_odds, found.time_offset_s,
      static_cast<int>(found.status), found.runner_up);
  print_structure(found, robot, recording);
}

Tally run_cell(const Cell& cell, int trials, bool verbose) {
  Tally tally;
  for (int trial = 0; trial < trials; ++trial) {
    Rng rng = Rng::from_name("structure_grid " + cell.name, static_cast<std::uint64_t>(trial));
    const RandomRobot robot = random_robot(cell.robot, rng);
    const RobotRecording recording = record(robot, cell.recording, rng);
    const bool anchor_applies = cell.robot.unmarked_links.empty() &&
                                cell.robot.markers_per_link == 1 && cell.robot.base_marker;
    ++tally.trials;
    auto start = std::chrono::steady_clock::now();
    if (anchor_applies) {
      const auto edges =
          find_edges_2019(recording.tracks, recording.log,
                          {cell.recording.sigma_rad, cell.recording.sigma_m, !cell.robot.tree});
      tally.anchor_ms += milliseconds_since(start);
      tally.anchor_right += is_right(edges, robot, recording) ? 1 : 0;
    }
    start = std::chrono::steady_clock::now();
    const Structure found = find_structure(recording.tracks, recording.log);
    tally.ms += milliseconds_since(start);
    const bool right = is_right(found, robot, recording);
    tally.right += right ? 1 : 0;
    const bool sure = found.probability >= 0.99 && found.status == StructureStatus::kDetermined;
    tally.sure += sure ? 1 : 0;
    tally.sure_wrong += sure && !right ? 1 : 0;
    if (verbose && !right) explain(cell, trial, found, robot, recording);
  }
  return tally;
}

void print(const Cell& cell, const Tally& t) {
  const double n = t.trials;
  fmt::print("{:44} {:7.1f} {:7.1f} {:9.1f} {:9.1f} {:8.1f} {:10}\n", cell.name,
             100.0 * t.anchor_right / n, 100.0 * t.right / n, t.anchor_ms / n, t.ms / n,
             100.0 * t.sure / n, t.sure > 0 ? fmt::format("{}/{}", t.sure_wrong, t.sure) : "-");
  std::fflush(stdout);
}

std::vector<Cell> base_cells() {
  struct Noise {
    double mm;
    double deg;
  };
  std::vector<Cell> cells;
  for (const int joints : {3, 6, 10}) {
    for (const int frames : {100, 600}) {
      for (const Noise noise :
           {Noise{1, 0.1}, Noise{3, 0.5}, Noise{5, 1}, Noise{10, 3}, Noise{20, 6}, Noise{40, 12}}) {
        Cell cell;
        cell.name =
            fmt::format("base n={} frames={} {}mm/{}deg", joints, frames, noise.mm, noise.deg);
        cell.robot.joints = joints;
        cell.recording.frames = frames;
        cell.recording.sigma_m = 1e-3 * noise.mm;
        cell.recording.sigma_rad = noise.deg * kDegree;
        cells.push_back(std::move(cell));
      }
    }
  }
  return cells;
}

Cell stress_cell(const std::string& name) {
  Cell cell;
  cell.name = "stress " + name;
  cell.recording.sigma_m = 3e-3;
  cell.recording.sigma_rad = 0.5 * kDegree;
  return cell;
}

template <typename Change>
void add_stress(std::vector<Cell>& cells, const std::string& name, Change&& change) {
  Cell cell = stress_cell(name);
  change(cell);
  cells.push_back(std::move(cell));
}

std::vector<Cell> stress_cells() {
  std::vector<Cell> cells;
  add_stress(cells, "none", [](Cell&) {});
  for (const double share : {0.02, 0.05, 0.1, 0.2}) {
    add_stress(cells, fmt::format("flips {}", share),
               [&](Cell& c) { c.recording.flip_share = share; });
    add_stress(cells, fmt::format("flips {} both branches", share), [&](Cell& c) {
      c.recording.flip_share = share;
      c.recording.alternatives = true;
    });
  }
  for (const double scale : {1.05, 1.2, 2.0}) {
    add_stress(cells, fmt::format("scale {}", scale),
               [&](Cell& c) { c.recording.channel_scale = scale; });
  }
  add_stress(cells, "ticks and signs",
             [](Cell& c) { c.recording.ticks = c.recording.random_signs = true; });
  add_stress(cells, "degrees", [](Cell& c) { c.recording.channel_scale = 1.0 / kDegree; });
  for (const double coupling : {0.3, 1.0}) {
    add_stress(cells, fmt::format("coupling {}", coupling),
               [&](Cell& c) { c.recording.coupling = coupling; });
  }
  for (const double lag : {0.05, 0.2, 0.5, -0.9}) {
    add_stress(cells, fmt::format("lag {}", lag), [&](Cell& c) { c.recording.lag_s = lag; });
  }
  for (const double gap : {3.0, 10.0}) {
    add_stress(cells, fmt::format("backlash {} deg", gap),
               [&](Cell& c) { c.recording.backlash_rad = gap * kDegree; });
  }
  for (const double amplitude : {0.1, 0.05, 0.02}) {
    add_stress(cells, fmt::format("amplitude {}", amplitude),
               [&](Cell& c) { c.recording.amplitude_rad = amplitude; });
  }
  add_stress(cells, "parallel axes", [](Cell& c) { c.robot.parallel_axes = true; });
  add_stress(cells, "parallel axes 0.1 rad 6 s", [](Cell& c) {
    c.robot.parallel_axes = true;
    c.recording.amplitude_rad = 0.1;
    c.recording.frames = 180;
  });
  return cells;
}

std::vector<Cell> further_cells() {
  std::vector<Cell> cells;
  for (const int joints : {6, 10, 20}) {
    add_stress(cells, fmt::format("tree n={}", joints), [&](Cell& c) {
      c.robot.joints = joints;
      c.robot.tree = true;
    });
  }
  add_stress(cells, "tree n=10 two markers a link", [](Cell& c) {
    c.robot.joints = 10;
    c.robot.tree = true;
    c.robot.markers_per_link = 2;
  });
  add_stress(cells, "no base marker", [](Cell& c) { c.robot.base_marker = false; });
  add_stress(cells, "missing 30 % of sightings", [](Cell& c) { c.recording.missing_share = 0.3; });
  add_stress(cells, "three idle channels", [](Cell& c) { c.recording.idle_channels = 3; });
  add_stress(cells, "one link without marker", [](Cell& c) { c.robot.unmarked_links = {3}; });
  add_stress(cells, "declared noise x5", [](Cell& c) { c.recording.declared_noise = 5.0; });
  add_stress(cells, "declared noise / 5", [](Cell& c) { c.recording.declared_noise = 0.2; });
  add_stress(cells, "flips 0.2 ticks lag 0.5 coupling 0.3", [](Cell& c) {
    c.recording.flip_share = 0.2;
    c.recording.ticks = c.recording.random_signs = true;
    c.recording.lag_s = 0.5;
    c.recording.coupling = 0.3;
  });
  add_stress(cells, "n=30 frames=3000", [](Cell& c) {
    c.robot.joints = 30;
    c.recording.frames = 3000;
  });
  return cells;
}

int run(int trials, const std::string& part, bool verbose) {
  std::vector<Cell> cells = base_cells();
  for (auto& c : stress_cells()) cells.push_back(std::move(c));
  for (auto& c : further_cells()) cells.push_back(std::move(c));
  fmt::print(
      "Success in %, {} trials a cell, identical recordings. sure: answers with probability >= "
      "0.99.\n",
      trials);
  fmt::print("{:44} {:>7} {:>7} {:>9} {:>9} {:>8} {:>10}\n", "cell", "2019", "ours", "2019 ms",
             "ours ms", "sure %", "sure wrong");
  int sure = 0;
  int sure_wrong = 0;
  for (const Cell& cell : cells) {
    if (cell.name.find(part) == std::string::npos) continue;
    const Tally t = run_cell(cell, trials, verbose);
    print(cell, t);
    sure += t.sure;
    sure_wrong += t.sure_wrong;
  }
  fmt::print("wrong among answers with probability >= 0.99: {} of {}\n", sure_wrong, sure);
  return 0;
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  const int trials = argc > 1 ? std::atoi(argv[1]) : 10;
  const bool verbose = argc > 3;
  return kinescope::run(trials, argc > 2 ? argv[2] : "", verbose);
}
