// SPDX-License-Identifier: Apache-2.0
//
// find_structure over joints and frames, beside the tests of pairs of 2019 on the same recording
// (markers that are neighbours, by one regression a pair and channel: no clock offset, no channel
// of unknown scale, no flips, no probability). Times per recording, on the clock; the ratio of the
// two is what to compare between machines. Goals: 10 joints and 600 frames in 5 ms, 30 joints and
// 3000 frames in 1 s on two cores, cost linear in the frames.
#include <benchmark/benchmark.h>

#include "kinematics/structure/structure.h"
#include "tests/experiments/anchor_2019.h"
#include "tests/truth/random_robot.h"

namespace kinescope {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

RobotRecording recording_of(const benchmark::State& state) {
  Rng rng = Rng::from_name("bench_structure_search", static_cast<std::uint64_t>(state.range(0)));
  RandomRobotOptions robot;
  robot.joints = static_cast<int>(state.range(0));
  RecordingOptions recording;
  recording.frames = static_cast<int>(state.range(1));
  recording.sigma_m = 3e-3;
  recording.sigma_rad = 0.5 * kDegree;
  return record(random_robot(robot, rng), recording, rng);
}

void BM_FindStructure(benchmark::State& state) {
  const RobotRecording recording = recording_of(state);
  for (auto _ : state) benchmark::DoNotOptimize(find_structure(recording.tracks, recording.log));
  state.SetComplexityN(state.range(1));
}

// Clocks known to agree.
void BM_FindStructureWithoutScan(benchmark::State& state) {
  const RobotRecording recording = recording_of(state);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        find_structure(recording.tracks, recording.log, {.scan_time_offset = false}));
  }
}

void BM_PairTests2019(benchmark::State& state) {
  const RobotRecording recording = recording_of(state);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        find_edges_2019(recording.tracks, recording.log, {0.5 * kDegree, 3e-3, true}));
  }
}

void sizes(benchmark::internal::Benchmark* bench) {
  for (const int joints : {3, 6, 10, 20}) {
    for (const int frames : {100, 600}) bench->Args({joints, frames});
  }
  bench->Args({30, 3000});
  bench->ArgNames({"joints", "frames"})->Unit(benchmark::kMillisecond)->UseRealTime();
}

// Cost over the length of the recording.
void lengths(benchmark::internal::Benchmark* bench) {
  for (const int frames : {600, 1200, 2400, 4800, 9600}) bench->Args({10, frames});
  bench->ArgNames({"joints", "frames"})->Unit(benchmark::kMillisecond)->UseRealTime();
  bench->Complexity(benchmark::oN);
}

BENCHMARK(BM_FindStructure)->Apply(sizes);
BENCHMARK(BM_FindStructure)->Apply(lengths)->Name("BM_FindStructureOverFrames");
BENCHMARK(BM_FindStructureWithoutScan)->Apply(sizes);
BENCHMARK(BM_PairTests2019)->Apply(sizes);

}  // namespace
}  // namespace kinescope
