// SPDX-License-Identifier: Apache-2.0
//
// The clock offset that structure search finds, over random robots (turns and slides, slow and
// fast, one to eight joints) and recordings (flips, missing sightings, ticks, couplings, idle
// channels) with offsets from -0.9 to 0.9 s. Usage: structure_lag [cases, default 500] [first case]
// [any third word: print every wrong case]
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "tests/experiments/structure_check.h"

namespace kinescope {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
// An offset further off than this (s) belongs to another minimum.
constexpr double kWrongBasin = 0.03;

struct Case {
  std::string speed;
  RandomRobotOptions robot;
  RecordingOptions recording;
};

struct Speed {
  const char* name;
  double lowest_hz;
  double highest_hz;
};

Case random_case(Rng& rng) {
  constexpr std::array<Speed, 3> kSpeeds{
      {{"slow", 0.02, 0.08}, {"usual", 0.05, 0.25}, {"fast", 0.3, 1.2}}};
  Case c;
  const Speed& speed = kSpeeds[static_cast<std::size_t>(rng.index(3))];
  c.speed = speed.name;
  c.recording.lowest_hz = speed.lowest_hz;
  c.recording.highest_hz = speed.highest_hz;
  c.robot.joints = 1 + rng.index(8);
  c.robot.prismatic_share = std::array{0.0, 0.3, 1.0}[static_cast<std::size_t>(rng.index(3))];
  c.robot.tree = rng.index(4) == 0;
  c.robot.base_marker = rng.index(4) != 0;
  c.recording.frames = 240 + rng.index(400);
  const double noise = rng.uniform(0.3, 4.0);
  c.recording.sigma_m = 1e-3 * noise;
  c.recording.sigma_rad = 0.15 * kDegree * noise;
  // Poses from the corners of planar targets: far ones have much noise, and all in depth and tilt.
  if (rng.index(2) == 0) c.recording.corner_px = rng.uniform(0.05, 0.4);
  c.recording.lag_s = rng.uniform(-0.9, 0.9);
  if (rng.index(4) == 0) c.recording.log_margin_s = 0.1;
  if (rng.index(3) == 0) c.recording.flip_share = rng.uniform(0.0, 0.1);
  c.recording.alternatives = rng.index(2) == 0;
  if (rng.index(3) == 0) c.recording.missing_share = rng.uniform(0.0, 0.3);
  c.recording.ticks = c.recording.random_signs = rng.index(3) == 0;
  c.recording.idle_channels = rng.index(3);
  if (rng.index(5) == 0) c.recording.coupling = 0.3;
  return c;
}

struct Tally {
  std::vector<double> errors_s;
  std::vector<double> over_sigma;
  int right = 0;
  int wrong_basin = 0;
};

std::string words(const Case& c) {
  return fmt::format(
      "{} n={} {} prismatic {} frames {} noise {:.1f} mm {:.2f} px flips {:.2f}{} missing {:.2f} "
      "ticks {} idle {} coupling {} margin {}",
      c.speed, c.robot.joints, c.robot.tree ? "tree" : "chain", c.robot.prismatic_share,
      c.recording.frames, 1e3 * c.recording.sigma_m, c.recording.corner_px, c.recording.flip_share,
      c.recording.alternatives ? " both" : "", c.recording.missing_share, c.recording.ticks,
      c.recording.idle_channels, c.recording.coupling, c.recording.log_margin_s);
}

void add(Tally& tally, const Structure& found, double error_s, bool right) {
  tally.errors_s.push_back(std::abs(error_s));
  tally.over_sigma.push_back(std::abs(error_s) / std::max(1e-9, found.time_offset_sigma_s));
  tally.right += right ? 1 : 0;
  tally.wrong_basin += std::abs(error_s) > kWrongBasin ? 1 : 0;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  const auto last = static_cast<double>(values.size() - 1);
  return values[static_cast<std::size_t>(share * last)];
}

void print(const std::string& name, const Tally& t) {
  const auto n = static_cast<double>(std::max<std::size_t>(1, t.errors_s.size()));
  fmt::print("{:8} {:6} {:10.1f} {:12} {:12.2f} {:12.2f} {:12.2f} {:14.2f}\n", name,
             t.errors_s.size(), 100.0 * t.right / n, t.wrong_basin, 1e3 * quantile(t.errors_s, 0.5),
             1e3 * quantile(t.errors_s, 0.95), 1e3 * quantile(t.errors_s, 1.0),
             quantile(t.over_sigma, 0.68));
}

int run(int cases, int first, bool verbose) {
  Tally all;
  std::vector<std::pair<std::string, Tally>> by_speed{{"slow", {}}, {"usual", {}}, {"fast", {}}};
  const auto start = std::chrono::steady_clock::now();
  for (int k = first; k < first + cases; ++k) {
    Rng rng = Rng::from_name("structure_lag", static_cast<std::uint64_t>(k));
    const Case c = random_case(rng);
    const RandomRobot robot = random_robot(c.robot, rng);
    const RobotRecording recording = record(robot, c.recording, rng);
    const Structure found = find_structure(recording.tracks, recording.log);
    const bool right = is_right(found, robot, recording);
    const double error = found.time_offset_s - c.recording.lag_s;
    add(all, found, error, right);
    for (auto& [speed, tally] : by_speed) {
      if (speed == c.speed) add(tally, found, error, right);
    }
    if (!verbose || (right && std::abs(error) < kWrongBasin)) continue;
    fmt::print(
        "case {}: offset {:.4f} for {:.4f} (sigma {:.4f}) structure {} status {} p {:.3f}: {}\n", k,
        found.time_offset_s, c.recording.lag_s, found.time_offset_sigma_s,
        right ? "right" : "wrong", static_cast<int>(found.status), found.probability, words(c));
    if (!right) print_structure(found, robot, recording);
    std::fflush(stdout);
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  fmt::print("{:8} {:>6} {:>10} {:>12} {:>12} {:>12} {:>12} {:>14}\n", "speed", "cases", "right %",
             "wrong basin", "median ms", "95 % ms", "worst ms", "68 % in sigma");
  for (const auto& [speed, tally] : by_speed) print(speed, tally);
  print("all", all);
  fmt::print("{:.0f} ms a case\n", 1e3 * seconds / cases);
  return all.wrong_basin > 0 ? 1 : 0;
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  const int cases = argc > 1 ? std::atoi(argv[1]) : 500;
  const int first = argc > 2 ? std::atoi(argv[2]) : 0;
  return kinescope::run(cases, first, argc > 3);
}
