// SPDX-License-Identifier: Apache-2.0
//
// What tracing asks of one recording, over frames: the fit beside one effect, the tests of all
// effects, the search for what is left, the prediction of instants held out. A seven-axis arm with
// play in one joint, by corners; times on the clock.
#include <benchmark/benchmark.h>

#include "calib/bundle/effect_bundle.h"
#include "calib/effects/traced_bundle.h"
#include "calib/trace/family.h"
#include "calib/trace/rest.h"
#include "calib/trace/stage.h"
#include "tests/truth/camera_effects.h"

namespace kinescope {
namespace {

using trace::StagePtr;

const AddedEffect kPlay{{"backlash", "q3"}, 0.03};

struct Filmed {
  truth::World world;
  EffectBundle bundle;
  effects::TracedBundle model;

  explicit Filmed(int frames) : Filmed(world_of(frames), {}) {}

 private:
  Filmed(truth::World&& of, const CalibrationTraceOptions& options)
      : world(std::move(of)),
        bundle(world.measurements, world.markers, world.log,
               truth::perturbed_start(world, 0.005, 0.001, 1), options.calibrate),
        model(bundle, options) {}

  static truth::World world_of(int frames) {
    truth::EffectWorldOptions options;
    options.kind = truth::RobotKind::kArm7;
    options.frames = frames;
    options.sigma_px = 0.03;
    options.effects = {{"backlash", "q3", 0.01, 0.0, "q3"}};
    return truth::make_effect_world(options);
  }
};

void BM_FitBesideAnEffect(benchmark::State& state) {
  const Filmed filmed(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(trace::make_stage(filmed.model, {kPlay}));
}

void BM_TestAllEffects(benchmark::State& state) {
  const Filmed filmed(static_cast<int>(state.range(0)));
  const StagePtr stage = trace::make_stage(filmed.model, {});
  for (auto _ : state)
    benchmark::DoNotOptimize(trace::test_family(stage->system, stage->fit.candidates));
}

void BM_FindRest(benchmark::State& state) {
  const Filmed filmed(static_cast<int>(state.range(0)));
  const StagePtr stage = trace::make_stage(filmed.model, {kPlay});
  for (auto _ : state) {
    benchmark::DoNotOptimize(trace::find_rest(stage->system, stage->fit.rest_places,
                                              stage->fit.covariates, {}, 1e-3, {}));
  }
}

void BM_HeldOut(benchmark::State& state) {
  const Filmed filmed(static_cast<int>(state.range(0)));
  const StagePtr stage = trace::make_stage(filmed.model, {});
  const Candidate* play = trace::find_candidate(stage->fit, kPlay.id);
  const auto columns = play->columns(kPlay.scan);
  for (auto _ : state) benchmark::DoNotOptimize(trace::held_out_instants(stage->system, columns));
}

void frames(benchmark::internal::Benchmark* bench) {
  bench->Arg(150)->Arg(600)->ArgName("frames")->Unit(benchmark::kMillisecond)->UseRealTime();
}

BENCHMARK(BM_FitBesideAnEffect)->Apply(frames);
BENCHMARK(BM_TestAllEffects)->Apply(frames);
BENCHMARK(BM_FindRest)->Apply(frames);
BENCHMARK(BM_HeldOut)->Apply(frames);

}  // namespace
}  // namespace kinescope
