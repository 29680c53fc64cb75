// SPDX-License-Identifier: Apache-2.0
//
// One sample of a running robot: the balance of momentum, the detector, and the momentum observer's
// whole log beside them. Items are samples; the range is the number of joints.
#include <benchmark/benchmark.h>

#include "dynamics/contact/detector.h"
#include "dynamics/contact/momentum_observer.h"
#include "dynamics/experiments/contact_world.h"

namespace kinescope {
namespace {

using namespace experiments;

struct Log {
  DynamicModel model;
  ContactWorld world;
  std::vector<BalanceSample> samples;
};

Log free_log(int joints) {
  Rng rng = Rng::from_name("bench.contact");
  Log out;
  out.model = contact_arm(joints);
  out.world = contact_world(out.model, {.duration_s = 10.0}, rng);
  out.samples = balance_samples(RigidBalance(make_rigid_model(out.model), friction_of(out.model)),
                                out.world.samples);
  return out;
}

void balance(benchmark::State& state) {
  const Log log = free_log(static_cast<int>(state.range(0)));
  RigidBalance balance(make_rigid_model(log.model), friction_of(log.model));
  const Eigen::VectorXd q = log.world.samples.q.row(0);
  const Eigen::VectorXd dq = log.world.samples.dq.row(0);
  const Eigen::VectorXd torque = log.world.samples.torque.row(0);
  for (auto _ : state) benchmark::DoNotOptimize(balance.evaluate(0.0, q, dq, torque));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(balance)->Arg(2)->Arg(6)->Arg(7);

void detector(benchmark::State& state) {
  const Log log = free_log(static_cast<int>(state.range(0)));
  const ContactCalibration calibration = calibrate_contacts(log.samples);
  for (auto _ : state) {
    ContactDetector detector(calibration);
    for (const BalanceSample& sample : log.samples) {
      benchmark::DoNotOptimize(detector.update(sample));
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(log.samples.size()));
}
BENCHMARK(detector)->Arg(2)->Arg(6)->Arg(7);

void observer(benchmark::State& state) {
  const Log log = free_log(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(observe_momentum(log.samples, 40.0));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(log.samples.size()));
}
BENCHMARK(observer)->Arg(6);

}  // namespace
}  // namespace kinescope
